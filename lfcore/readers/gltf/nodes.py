"""Where a glTF file's meshes, lights and cameras are.

Source: Khronos, "glTF 2.0 Specification", sections 3.5, 3.7.3 and 3.10, and the extensions
EXT_mesh_gpu_instancing, KHR_lights_punctual and KHR_node_visibility.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from lfcore.readers.account import Account
from lfcore.readers.gltf.animations import Pose
from lfcore.readers.gltf.document import Document, extension
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light
from lfcore.scene.framing import FoundCamera
from lfcore.scene.notes import APPROXIMATED, NOT_USED
from lfcore.scene.surface_mesh import normalise, triple
from lfcore.scene.transforms import affine

LIGHTS, INSTANCES = "KHR_lights_punctual", "EXT_mesh_gpu_instancing"
IDENTITY = (0.0, 0.0, 0.0, 1.0)
"""The quaternion that turns nothing."""


class Nodes:
    """The nodes of the scene that is shown, in the pose of an animation.

    ``shown`` are their indices and their (4, 4) matrices to the world, in order.
    """

    def __init__(self, document: Document, account: Account, pose: Pose):
        self.document, self.account, self.pose = document, account, pose
        self.entries = document.entries("nodes")
        self.shown = list(self._below(self._roots()))
        self._world = dict(self.shown)

    def _roots(self) -> list[int]:
        scenes = self.document.entries("scenes")
        children = {child for node in self.entries for child in node.get("children", ())}
        self._parents = {
            child: index
            for index, node in enumerate(self.entries)
            for child in node.get("children", ())
        }
        if not scenes:
            return [index for index in range(len(self.entries)) if index not in children]
        self.account.hold("scenes", len(scenes))
        self.account.use("scenes")
        return self.document.entry("scenes", self.document.tree.get("scene", 0)).get("nodes", [])

    def _below(self, roots: list[int]) -> Iterator[tuple[int, np.ndarray]]:
        waiting, visited = [(index, np.eye(4)) for index in reversed(roots)], set()
        while waiting:
            index, above = waiting.pop()
            node = self.document.entry("nodes", index)
            if (
                index in visited
                or (extension(node, "KHR_node_visibility") or {}).get("visible") is False
            ):
                continue
            visited.add(index)
            matrix = above @ self._matrix(index)
            yield index, matrix
            waiting += [(child, matrix) for child in reversed(node.get("children", []))]

    def _matrix(self, index: int) -> np.ndarray:
        node = self.document.entry("nodes", index)
        if "matrix" in node:
            return self.document.numbers(node, "matrix", [0] * 16).reshape(4, 4).T

        def now(name: str, default: tuple[float, ...]) -> np.ndarray:
            moved = self.pose.get((index, name))
            return self.document.numbers(node, name, default) if moved is None else moved

        turned = self.turns(now("rotation", IDENTITY)[None])[0]
        return affine(turned * now("scale", (1.0, 1, 1)), now("translation", (0.0, 0, 0)))

    def turns(self, quaternions: np.ndarray) -> np.ndarray:
        """(N, 3, 3) of quaternions (N, 4) of any length, w last."""
        if (quaternions == IDENTITY).all():
            return np.broadcast_to(np.eye(3), (len(quaternions), 3, 3))
        from scipy.spatial.transform import Rotation  # slow to import

        try:
            return Rotation.from_quat(quaternions).as_matrix()
        except ValueError as error:
            raise self.document.broken(f"a node's rotation makes no sense: {error}") from None

    def world(self, index: int) -> np.ndarray:
        """(4, 4) pose of any node, also of a hidden one."""
        chain: list[int] = []
        at: int | None = index
        while at is not None and at not in self._world and at not in chain:
            chain.append(at)
            at = self._parents.get(at)
        for node in reversed(chain):
            above = self._world.get(self._parents.get(node, -1), np.eye(4))
            self._world[node] = above @ self._matrix(node)
        return self._world[index]

    def instances(self, node: dict, matrix: np.ndarray) -> list[np.ndarray]:
        """The (4, 4) matrices of a node's meshes: its own, or those of its instances."""
        packed = extension(node, INSTANCES)
        if packed is None:
            return [matrix]
        accessors = packed["attributes"]
        values = {
            name: self.document.accessor(accessors[name], unit=name == "ROTATION").astype(float)
            for name in ("TRANSLATION", "ROTATION", "SCALE")
            if name in accessors
        }
        count = len(next(iter(values.values()), [None]))
        turned = self.turns(values.get("ROTATION", np.tile(IDENTITY, (count, 1))))
        sizes = values.get("SCALE", np.ones((count, 3)))
        places = values.get("TRANSLATION", np.zeros((count, 3)))
        poses = zip(turned, sizes, places, strict=True)
        return [matrix @ affine(turn * size, place) for turn, size, place in poses]

    # -- lights and cameras -------------------------------------------------------------------

    def lights(self) -> list[Light]:
        """The lights, in the world.

        Candela and lux are divided by pi: in glTF a matt surface of colour c reflects c / pi of the
        irradiance, here it reflects c.
        """
        definitions = (extension(self.document.tree, LIGHTS) or {}).get("lights", [])
        self.account.hold("lights", len(definitions))
        lights, numbers = [], set()
        for index, matrix in self.shown:
            reference = extension(self.entries[index], LIGHTS)
            if reference is None:
                continue
            number = reference.get("light")
            if not isinstance(number, int) or not 0 <= number < len(definitions):
                raise self.document.broken(f"a node names light {number!r} of {len(definitions)}")
            lights.append(self._light(definitions[number], matrix))
            numbers.add(number)
        self.account.use("lights", len(numbers))
        return lights

    def _light(self, light: dict, matrix: np.ndarray) -> Light:
        name, kind = light.get("name", "without name"), light.get("type")
        numbers, number = self.document.numbers, self.document.number
        strength = number(light, "intensity", 1.0) / math.pi
        colour = triple(numbers(light, "color", (1.0, 1, 1)) * strength)
        if kind == "directional":
            # It shines along the node's -z.
            return Light(DIRECTIONAL, triple(normalise(matrix[:3, 2])), colour)
        if kind not in ("point", "spot"):
            raise self.document.broken(f"light {name!r} is of no known type: {kind!r}")
        if "range" in light:
            self.account.lose(
                "lights", APPROXIMATED, f"light {name!r}: its range, beyond which it shines on", 0
            )
        point = Light(POINT, triple(matrix[:3, 3]), colour, 1.0)
        if kind == "point":
            return point
        spot = light.get("spot", {})
        angles = number(spot, "innerConeAngle", 0.0), number(spot, "outerConeAngle", math.pi / 4)
        if not 0 <= angles[0] < angles[1] <= math.pi / 2 + 1e-6:
            raise self.document.broken(f"the cone of light {name!r} makes no sense: {angles}")
        inner, outer = (max(math.cos(angle), 0.0) for angle in angles)
        return replace(point, normal=triple(-normalise(matrix[:3, 2])), cone=(inner, outer))

    def camera(self) -> FoundCamera | None:
        """The first perspective camera of the scene; others are noted."""
        first = None
        self.account.hold("cameras", len(self.document.entries("cameras")))
        for index, matrix in self.shown:
            node = self.entries[index]
            if "camera" not in node:
                continue
            camera = self.document.entry("cameras", node["camera"])
            found_camera = self._perspective(camera, matrix)
            if found_camera is None or first is not None:
                name = camera.get("name") or node.get("name") or node["camera"]
                self.account.lose("cameras", NOT_USED, f"camera {name!r}")
            else:
                first = found_camera
                self.account.use("cameras")
        return first

    def _perspective(self, camera: dict, matrix: np.ndarray) -> FoundCamera | None:
        lens = camera.get("perspective")
        if lens is None:
            return None
        axes = normalise(matrix[:3, :3].T).T
        square = np.allclose(axes.T @ axes, np.eye(3), atol=1e-4) and np.linalg.det(axes) > 0
        angle = self.document.number(lens, "yfov", 0.0)
        aspect = self.document.number(lens, "aspectRatio", 1.0)
        if not (0 < angle < math.pi and aspect > 0 and square):
            return None
        width = 2 * math.tan(angle / 2) * min(aspect, 1.0)
        return FoundCamera(affine(axes, matrix[:3, 3]), width)
