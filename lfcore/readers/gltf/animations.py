"""The animation of a glTF file: what its nodes are at an instant.

Source: Khronos, "glTF 2.0 Specification", section 3.11 and appendix C.
"""

from typing import Any

import numpy as np

from lfcore.errors import SceneError
from lfcore.readers.account import Account
from lfcore.readers.gltf.document import Document
from lfcore.scene.curves import CUBIC, LINEAR, STEP, Curve
from lfcore.scene.notes import LEFT_OUT, NOT_USED

WIDTHS = {"translation": 3, "rotation": 4, "scale": 3}
Pose = dict[tuple[int, str], np.ndarray]
"""What an animation sets: by node and property, in place of the node's own."""


class Animation:
    """The animation of a document that is played: the one of a name, else the first that moves.

    Attributes
    ----------
    curves : dict
        The curve of each node and property.
    """

    def __init__(self, document: Document, account: Account, name: str | None = None):
        self.document, self.curves = document, dict[tuple[int, str], Curve]()
        entries = document.entries("animations")
        names = [str(entry.get("name", number)) for number, entry in enumerate(entries)]
        if name is not None and name not in names:
            known = ", ".join(map(repr, names)) or "none"
            raise document.broken(f"it has no animation {name!r}", f"It has: {known}")
        account.hold("animations", len(entries))
        for label, entry in zip(names, entries, strict=True):
            if self.curves or name not in (None, label):
                what = f'animation {label!r}; animation="{label}" plays it'
                account.lose("animations", NOT_USED, what)
                continue
            self._read(label, entry, account)
            if self.curves:
                account.use("animations")
            else:
                account.lose("animations", LEFT_OUT, f"animation {label!r}: it moves no node")

    @property
    def span(self) -> tuple[float, float] | None:
        """When it begins and ends, seconds; None if nothing moves."""
        if not self.curves:
            return None
        times = [curve.times for curve in self.curves.values()]
        return float(min(each[0] for each in times)), float(max(each[-1] for each in times))

    def at(self, time_s: float) -> Pose:
        """What nodes are at an instant."""
        return {place: curve.at(time_s) for place, curve in self.curves.items()}

    def _read(self, name: str, entry: dict, account: Account) -> None:
        samplers = entry.get("samplers", [])
        for channel in entry.get("channels", []):
            target, number = channel["target"], channel["sampler"]
            path, node = target["path"], target.get("node")
            if path not in (*WIDTHS, "weights"):
                account.lose("animations", LEFT_OUT, f"animation {name!r}: it moves {path!r}", 0)
            if node is None or path not in (*WIDTHS, "weights"):
                continue
            if not isinstance(number, int) or not 0 <= number < len(samplers):
                raise self._wrong(name, f"names sampler {number!r} of {len(samplers)}")
            moved = self.document.entry("nodes", node)
            if "matrix" in moved and path != "weights":
                raise self._wrong(name, f"moves node {node}, which has a matrix")
            self.curves[node, path] = self._curve(name, samplers[number], path, moved)

    def _curve(self, name: str, sampler: dict, path: str, node: dict) -> Curve:
        times = self.document.accessor(sampler["input"])[:, 0].astype(np.float64)
        kind = sampler.get("interpolation", LINEAR)
        if kind not in (STEP, LINEAR, CUBIC):
            raise self._wrong(name, f"has the interpolation {kind!r}")
        if not len(times):
            raise self._wrong(name, "has no keys")
        if not np.isfinite(times).all() or (np.diff(times) <= 0).any():
            key = int(np.flatnonzero(np.r_[~(np.diff(times) > 0), True])[0])
            raise self._wrong(name, f"has keys that run back: {times[key : key + 2].tolist()} s")
        width = WIDTHS.get(path) or self._targets(node)
        numbers = self.document.accessor(sampler["output"], unit=True).astype(np.float64)
        shape: Any = (len(times), 3, width) if kind == CUBIC else (len(times), width)
        if numbers.size != np.prod(shape) or not np.isfinite(numbers).all():
            needed = f"{np.prod(shape)} finite numbers for {len(times)} keys of {path}"
            raise self._wrong(name, f"has {numbers.size} values, and needs {needed}")
        return Curve(times, numbers.reshape(shape), kind, path == "rotation")

    def _targets(self, node: dict) -> int:
        """The morph targets of a node's mesh."""
        primitives = self.document.entry("meshes", node.get("mesh"))["primitives"]
        return max(len(primitive.get("targets", ())) for primitive in primitives)

    def _wrong(self, name: str, problem: str) -> SceneError:
        return self.document.broken(f"animation {name!r} {problem}")
