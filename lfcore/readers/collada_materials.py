"""The materials of COLLADA files: colours and textures of the common profile."""

import urllib.parse
import xml.etree.ElementTree as ET
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from lfcore.pictures import codes_of, decode
from lfcore.readers.account import Account
from lfcore.readers.side_files import beside, read_texture
from lfcore.readers.text import numbers
from lfcore.readers.zips import unpacked
from lfcore.reading import Where
from lfcore.scene.notes import LEFT_OUT
from lfcore.scene.surface_mesh import Surface, SurfaceMesh, triple

SHADERS = ("phong", "blinn", "lambert", "constant")
READ = ("diffuse", "emission", "specular", "shininess")
"""The values of a shader that are in the picture."""


def below(element: ET.Element, way: str) -> ET.Element:
    """The first element of a way; ValueError if there is none."""
    child = element.find(way)
    if child is None:
        raise ValueError(f"an element {element.tag!r} has no {way!r}")
    return child


def floats(element: ET.Element | None) -> np.ndarray:
    """The numbers of an element's text, some with a decimal comma; none of none."""
    text = "" if element is None else " ".join((element.text or "").replace(",", ".").split())
    return numbers(text.encode() + b"\n")[0] if text else np.zeros(0)


class Materials:
    """The surfaces of a file's materials, each made and noted once.

    Textures are looked for beside the file, or in ``archive``.
    """

    def __init__(
        self, path: Path, known: dict[str, ET.Element], account: Account,
        archive: zipfile.ZipFile | None,
    ):  # fmt: skip
        self.path, self.known, self.account, self.archive = path, known, account, archive
        self._made: dict[str, tuple[Surface, str]] = {}
        self._pictures: dict[str, np.ndarray | None] = {}

    @property
    def used(self) -> int:
        return len(self._made)

    def placed(
        self, part: SurfaceMesh, uvs: dict[int, np.ndarray], binding: ET.Element | None
    ) -> SurfaceMesh:
        """A part with the surface of its ``instance_material``, and the coordinates that this asks
        for among those of each set."""
        if binding is None:
            diffuse = (0.8 if part.colours is None else 1.0,) * 3
            return replace(part, surface=Surface(self.path.stem, diffuse))
        name = binding.get("target", "").removeprefix("#")
        if name not in self._made:
            self._made[name] = self._material(name)
        surface, channel = self._made[name]
        chosen = next(iter(sorted(uvs)), 0)
        for each in binding.findall("bind_vertex_input"):
            if each.get("semantic") == channel:
                chosen = int(each.get("input_set", chosen))
        if surface.has_textures and chosen not in uvs:
            what = f"textures of material {name!r}: a mesh has no coordinates for them"
            self.account.lose("materials", LEFT_OUT, what, 0)
        return replace(part, surface=surface, uvs=uvs.get(chosen))

    def _material(self, name: str) -> tuple[Surface, str]:
        """A surface, and the name of its texture coordinates."""
        material = self.known.get(name)
        link = None if material is None else material.find("instance_effect")
        effect = None if link is None else self.known.get(link.get("url", "")[1:])
        shaders = [] if effect is None else [each for tag in SHADERS for each in effect.iter(tag)]
        if effect is None or not shaders:
            what = f"material {name!r}, which is not in the file or has no known shader"
            self.account.lose("materials", LEFT_OUT, what, 0)
            return Surface(name), ""
        shader = shaders[0]
        params = {each.get("sid"): each for each in effect.iter("newparam")}
        for each in shader:
            what = f"values {each.tag!r}"
            plain = each.find("texture") is None and (floats(next(iter(each), None)) % 1 == 0).all()
            self.account.hold(what)
            if each.tag in READ or plain:
                self.account.use(what)
        black = np.zeros(3)
        colour = self._colour(shader, params, "diffuse", 0.8 * (shader.tag != "constant") + black)
        specular = self._colour(shader, params, "specular", black)
        exponent = float((*floats(shader.find("shininess/float")), 0.0)[0])
        if exponent < 1 and specular.any():
            specular = black
            what = f"highlights of material {name!r}, which have no exponent above 1"
            self.account.lose("materials", LEFT_OUT, what, 0)
        emission = self._colour(shader, params, "emission", black)
        channel, pictures = "", {}
        for tag in ("emission", "diffuse"):
            texture = shader.find(f"{tag}/texture")
            if texture is not None:
                pictures[tag] = self._picture(texture.get("texture", ""), params)
                channel = texture.get("texcoord", "")
        if pictures.get("diffuse", colour) is None:
            colour = np.full(3, 0.8)
        if pictures.get("emission", emission) is None:
            emission = black
        surface = Surface(
            name, triple(np.clip(colour, 0, 1)), triple(np.clip(specular, 0, 1)),
            float(np.clip(exponent, 1, 1000)), triple(np.maximum(emission, 0)),
            texture=pictures.get("diffuse"), emission_texture=pictures.get("emission"),
        )  # fmt: skip
        return surface, channel

    @staticmethod
    def _colour(shader: ET.Element, params: dict, tag: str, otherwise: np.ndarray) -> np.ndarray:
        """(3,) of a value of a shader, white below a texture."""
        if (value := shader.find(tag)) is None:
            return otherwise
        if value.find("texture") is not None:
            return np.ones(3)
        given = floats(value.find("color"))
        if (named := value.find("param")) is not None and named.get("ref") in params:
            given = floats(next(iter(params[named.get("ref")]), None))
        return given[:3] if len(given) >= 3 else otherwise

    def _picture(self, name: str, params: dict) -> np.ndarray | None:
        """(H, W, 3) uint8 of a sampler's or an image's name; None and a note if it is not there."""
        for way in ("sampler2D/source", "surface/init_from"):
            if name in params:
                name = (params[name].findtext(way) or "").strip()
        for param in params.values():  # 1.5
            if param.get("sid") == name and (image := param.find("sampler2D/instance_image")):
                name = image.get("url", "")[1:]
        if name not in self._pictures:
            image = self.known.get(name)
            ways = ("init_from", "init_from/ref")
            texts = [] if image is None else [image.findtext(way) or "" for way in ways]
            file = next((text.strip() for text in texts if text.strip()), name)
            self._pictures[name] = self._read(urllib.parse.unquote(file.removeprefix("file://")))
        return self._pictures[name]

    def _read(self, name: str) -> np.ndarray | None:
        self.account.hold("textures")
        if self.archive is not None:
            last = Path(name.replace("\\", "/")).name.lower()
            for inner in self.archive.namelist():
                if Path(inner).name.lower() == last:
                    self.account.use("textures")
                    return codes_of(decode(unpacked(self.path, self.archive, inner)))
        elif (file := beside(name, self.path)) is not None:
            self.account.use("textures")
            return read_texture(file, Where(self.path))
        self.account.lose("textures", LEFT_OUT, f"texture {name!r}, not found")
        return None
