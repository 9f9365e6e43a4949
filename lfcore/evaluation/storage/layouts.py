"""The storage table: macropixels and views, their orders, several macropixels a frame."""

from collections.abc import Iterator, Sequence

from lfcore.evaluation.storage.sample import Frames, own_planes, store, trace_sample
from lfcore.optics.size import Pixels, Size
from lfcore.progress import Progress, silent
from lfcore.storage.curves import ORDERS
from lfcore.storage.defaults import chosen_encoding, default_kind, default_pack, macropixel_pack
from lfcore.storage.layout import FrameLayout
from lfcore.tracing.tracer import Tracer

COLUMNS = [
    "scene", "N", "M", "window", "layout", "order", "pack", "frame_px", "is_default",
    "raw_bytes_float32", "video_bytes", "ratio_float32", "bits_per_ray", "psnr_frames_db",
    "psnr_pictures_db", "encode_seconds", "decode_seconds",
]  # fmt: skip
ORDER = "serpentine"
LARGEST_FRAME_PX = 512


def layouts(views: int, pixels: int, packs: Sequence[int]) -> Iterator[FrameLayout]:
    """All orders of views and of macropixels in their best pack, and macropixels in other packs.

    ``pixels`` are those of the sample.  Frames are no wider than 512 pixels, unless a single
    element is.
    """
    spec, best = chosen_encoding(views), min(macropixel_pack(views), pixels)
    for order in ORDERS:
        yield FrameLayout("views", views, pixels, order, 1, spec.stored_format)
    for order in ORDERS:
        yield FrameLayout("macropixels", views, pixels, order, best, spec.stored_format)
    for pack in packs:
        small = pack == 1 or pack * views <= LARGEST_FRAME_PX
        if pack != best and pack <= pixels and small:
            yield FrameLayout("macropixels", views, pixels, ORDER, pack, spec.stored_format)


def layout_rows(
    tracer: Tracer,
    pixels: Pixels,
    *,
    views: Sequence[int],
    rays: int,
    packs: Sequence[int],
    progress: Progress = silent,
) -> list[dict]:
    """Rows of one scene (columns :data:`COLUMNS`), at the encoder settings of each N of ``views``.

    Samples have at most ``rays``, a square window of a picture of so many ``pixels``; ``packs`` are
    macropixels per side of a frame, beside the default.
    """
    size = Size.of(pixels)
    planes, rows = own_planes(tracer.scene), []
    for step, n in enumerate(views):
        sample = trace_sample(tracer, planes, views=n, pixels=size.shorter, most_rays=rays)
        found = list(layouts(n, sample.slab.pixels, packs))
        for at, layout in enumerate(found):
            known = store(Frames(sample, layout), chosen_encoding(n), tracer.device)
            known |= {"scene": sample.scene, "N": n, "M": size.as_given}
            known |= {"window": layout.pixels, "frame_px": layout.frame_width}
            known |= {"layout": layout.kind, "order": layout.order, "pack": layout.pack}
            known["is_default"] = is_default(layout, size.longer)
            rows.append({column: known[column] for column in COLUMNS})
            progress(step * len(found) + at + 1, len(views) * len(found))
    return rows


def is_default(layout: FrameLayout, pixels: int) -> bool:
    """Whether a light field of M = ``pixels`` is stored so unless another layout is asked for."""
    best = default_kind(layout.views, pixels), ORDER, default_pack(layout.views, pixels)
    return (layout.kind, layout.order, layout.pack) == best
