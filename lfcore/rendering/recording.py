"""What :func:`lfcore.record` does: it chooses lattice, encoding and layout, then traces and stores.

A scene at one instant is traced with or without depth; a film has several instants, with depth.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from lfcore.errors import OpticsError
from lfcore.opencl.device import Device
from lfcore.optics.camera import Camera
from lfcore.optics.size import Size
from lfcore.optics.slab import Lattice, Slab
from lfcore.progress import Progress
from lfcore.rendering.defaults import lattice_to_store
from lfcore.rendering.prepared import open_tracer, open_tracers, opened, tracers_at
from lfcore.rendering.quality import Quality
from lfcore.rendering.record import peak_to_store, record_slab
from lfcore.rendering.record_depth import depth_store, record_by_depth
from lfcore.rendering.record_film import Ahead, Film, check_times, record_film
from lfcore.rendering.trials import plan_quality
from lfcore.scene.model import Scene
from lfcore.storage.codecs import Encoding
from lfcore.storage.defaults import chosen_encoding, frame_layout
from lfcore.tracing.tracer import Tracer


@dataclass(frozen=True)
class Recording:
    """A light field to record.

    Attributes
    ----------
    path : str or Path
        The file to write.
    scene, camera : Scene, Camera
        The scene, and the lens and focus that are recorded.
    size : Size
        The pictures that the file is made for.
    views : int, Lattice or None
        As of :func:`lfcore.record`.
    encoding : Encoding
        The caller's settings; None in them is a default.
    content : dict
        Facts for the file.
    device : Device, str or None
        As of :func:`lfcore.record`.
    progress : callable or None
        Called with (done, total).
    """

    path: str | Path
    scene: Scene
    camera: Camera
    size: Size
    views: int | Lattice | None
    encoding: Encoding
    content: dict[str, Any]
    device: Device | str | None
    progress: Progress | None

    def once(self, quality: Quality | None) -> None:
        """Record the scene at one instant."""
        tracer = open_tracer(self.scene, self.device, self.progress, by_depth=True)
        peak = peak_to_store(tracer, Slab.of(self.camera, 4, self.size), self.encoding.transfer)
        this = self._of_quality(tracer, peak, quality) if quality else self._stored_up_to(peak)
        by_depth, lattice = lattice_to_store(this.encoding.depth, this.views)
        slab = Slab.of(self.camera, lattice, self.size)
        spec = chosen_encoding(
            lattice.views, this.encoding, by_depth=by_depth, width=slab.size.width
        )
        if by_depth:
            kind = this.encoding.layout or "views"
            slab, store = depth_store(self.camera, lattice, self.size, spec, kind=kind, peak=peak)
            content = this._content_with_views()
            record_by_depth(self.path, tracer, slab, store, content=content, progress=self.progress)
            return
        frames = frame_layout(
            slab.views, slab.size, spec.stored_format, kind=this.encoding.layout, peak=peak
        )
        tracers = open_tracers(self.scene, self.device)
        record_slab(
            self.path, tracers, slab, frames, spec, content=this.content, progress=self.progress
        )

    def film(self, times: Sequence[float], quality: Quality | None, *, bake_each: bool) -> None:
        """Record the scene at some instants, in one file."""
        device = opened(self.device)
        film, content = self.planned_film(times, quality, bake_each=bake_each)
        record_film(self.path, film, device, content=content, progress=self.progress)

    def planned_film(
        self,
        times: Sequence[float],
        quality: Quality | None = None,
        *,
        bake_each: bool = False,
        ahead: Ahead | None = None,
    ) -> tuple[Film, dict[str, Any]]:
        """The film, and the facts for its file; ``ahead`` if a few rays were traced before.

        A ``quality`` chooses the rays of all instants by the middle one.
        """
        if self.encoding.depth is False or self.encoding.layout == "macropixels":
            problem = "a film has depth, and views"
            raise OpticsError(problem, key="encoding", remedy="Leave it out")
        times, device, this = check_times(times), opened(self.device), self
        if quality is not None:
            (tracer,) = tracers_at(self.scene, [times[len(times) // 2]], device)
            peak = peak_to_store(tracer, Slab.of(self.camera, 4, self.size), self.encoding.transfer)
            this = self._of_quality(tracer, peak, quality)
        _, lattice = lattice_to_store(this.encoding.depth, this.views)
        slab = Slab.of(self.camera, lattice, self.size)
        ahead = ahead or Ahead.of(self.scene, times, slab, device, self.encoding.transfer)
        this = this._stored_up_to(ahead.peak)
        spec = chosen_encoding(lattice.views, this.encoding, by_depth=True, width=slab.size.width)
        slab, store = depth_store(self.camera, lattice, self.size, spec, peak=ahead.peak)
        return Film(self.scene, ahead, slab, store, bake_each), this._content_with_views()

    def _of_quality(self, tracer: Tracer, peak: float | None, quality: Quality) -> "Recording":
        """The recording with the views and the encoding for a quality of pictures."""
        if self.encoding.depth is False or self.views is not None:
            problem = "chooses the rays itself, and stores depth"
            raise OpticsError(problem, key="quality", remedy="Leave out views and depth")
        this = self._stored_up_to(peak)
        views, encoding, expected = plan_quality(
            tracer, self.camera, self.size, quality, this.encoding, peak
        )
        content = self.content | {"expected": expected}
        return replace(this, views=views, encoding=encoding, content=content)

    def _stored_up_to(self, peak: float | None) -> "Recording":
        """The recording with the transfer function for light up to ``peak``; None: up to white."""
        return replace(self, encoding=replace(self.encoding, transfer="pq" if peak else "srgb"))

    def _content_with_views(self) -> dict[str, Any]:
        """The facts for a file with depth, with the number of views that it provides."""
        if self.views is None or isinstance(self.views, Lattice):
            return self.content
        return self.content | {"views": int(self.views)}
