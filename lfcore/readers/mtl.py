"""Wavefront MTL: the materials of OBJ files.

Source: Wavefront Technologies, "MTL material format" (1995); ``Pm``, ``Pr`` and ``norm`` are the
extension for physically based materials that Blender writes.
"""

import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.readers.account import Account
from lfcore.readers.side_files import SOLID, beside, is_mask, read_texture, same_size
from lfcore.readers.text import plain
from lfcore.reading import LARGEST_TEXT, Where, read_bytes
from lfcore.scene.notes import APPROXIMATED, ASSUMED, LEFT_OUT, NOT_USED, Notebook
from lfcore.scene.surface_mesh import Surface, SurfaceMesh, clipped, triple

Statements = dict[str, tuple[str, str]]
"""The statements of a material by their words in small letters: word as written, and the rest."""
MAPS = {"map_kd": "texture", "map_ke": "emission_texture", "norm": "normal_texture"}
OPTIONS = {
    "-blendu": 1, "-blendv": 1, "-boost": 1, "-cc": 1, "-clamp": 1, "-imfchan": 1, "-bm": 1,
    "-texres": 1, "-type": 1, "-mm": 2, "-o": 3, "-s": 3, "-t": 3,
}  # fmt: skip
"""The options of maps, and the most arguments of each."""
SEEN = {"-mm": "range", "-t": "turbulence", "-cc": "colour correction", "-imfchan": "channel"}
"""Options that change what is seen and are not followed."""
PLAIN = {"illum": (1.0, 2.0), "d": (1.0,), "tr": (0.0,), "ni": (1.0,), "tf": (1.0,), "ka": (0.0,)}
"""Values that say what is so anyway; illumination models 1 and 2 are matt and glossy."""
REFRACTIVE = 6, 7
"""Illumination models of glass that refracts."""
MOST_WORDS = 8
"""The most words of a library's name among several on a line."""
ROUNDING = 1e-4
"""What programs that write numbers in few digits may be beyond a range."""
WHITE = np.full((1, 1, 4), 255, np.uint8)


@dataclass(frozen=True)
class Map:
    """A texture statement: the file's name and its options."""

    name: str
    options: dict[str, list[str]]

    @classmethod
    def parse(cls, text: str) -> "Map":
        """Read ``-option arguments ... name``; names may have spaces, and be quoted."""
        options, words = {}, text.split()
        while len(words) > 1 and (option := words[0].lower()) in OPTIONS:
            text, words = text.split(None, 1)[1], words[1:]
            arguments: list[str] = []
            while len(words) > 1 and len(arguments) < OPTIONS[option]:
                if arguments and _number(words[0]) is None:
                    break
                arguments.append(words[0])
                text, words = text.split(None, 1)[1], words[1:]
            options[option] = arguments
        return cls(text.strip().strip('"'), options)

    def triple(self, option: str, default: float) -> np.ndarray:
        """(2,) numbers of ``-s`` or ``-o``, across and up."""
        numbers = [_number(word) for word in self.options.get(option, [])]
        return np.array([*(default if n is None else n for n in numbers), default, default])[:2]


def _number(word: str) -> float | None:
    try:
        number = float(word)
    except ValueError:
        return None
    return number if np.isfinite(number) else None


@dataclass(frozen=True, eq=False)
class Made:
    """A surface, and how its texture lies on the file's texture coordinates.

    One that is ``assumed``, for want of a material, is white below colours of vertices.
    """

    surface: Surface
    assumed: bool = False
    scale: np.ndarray = field(default_factory=lambda: np.ones(2))
    offset: np.ndarray = field(default_factory=lambda: np.zeros(2))

    def placed(self, part: SurfaceMesh) -> SurfaceMesh:
        uvs, surface = part.uvs, self.surface
        if self.assumed and part.colours is not None:
            surface = replace(surface, diffuse=(1.0,) * 3)
        if uvs is None and self.surface.alpha_cutoff:
            uvs = np.zeros((part.count, 3, 2))
        if uvs is not None and not ((self.scale == 1).all() and (self.offset == 0).all()):
            uvs = uvs * self.scale + self.offset
        return replace(part, surface=surface, uvs=uvs)


class Libraries:
    """The material libraries of an OBJ file; each material is made, and noted, once."""

    def __init__(self, obj: Path, notebook: Notebook, account: Account):
        self.obj, self._notebook, self._account = obj, notebook, account
        self._statements: dict[str, tuple[Path, Statements]] = {}
        self._accounts: dict[Path, Account] = {}
        self._lacking = False
        self._made: dict[str, Made] = {}

    def add(self, names: str) -> None:
        """Read the libraries of a ``mtllib`` statement: one name with spaces, or several."""
        names = names.strip().strip('"')
        words = [names] if beside(names, self.obj) else names.split()
        while words:
            # The longest run of words that is a file, else the next word alone.
            for count in range(min(len(words), MOST_WORDS), 0, -1):
                if file := beside(" ".join(words[:count]), self.obj):
                    self._read(file)
                    break
            else:
                self._lacking, count = True, 1
                what = f"material library {words[0]!r}, not found; the default material is used"
                self._notebook.add(LEFT_OUT, self.obj, what)
            words = words[count:]

    def _read(self, file: Path) -> None:
        if file in self._accounts:
            return
        self._accounts[file] = Account(self._notebook, file)
        text = plain(read_bytes(file, LARGEST_TEXT, "material library"), joined=True)
        statements: Statements = {}
        for line in text.decode("utf-8", errors="surrogateescape").split("\n"):
            word, _, rest = line.strip().partition(" ")
            if word.lower() == "newmtl":
                statements = {}
                self._statements[rest.strip()] = file, statements
            elif word and not word.startswith("#"):
                statements[word.lower()] = word, rest.strip()

    def surface(self, name: str) -> Made:
        """The surface of a material."""
        if name not in self._made:
            self._made[name] = self._make(name)
        return self._made[name]

    def _make(self, name: str) -> Made:
        if name not in self._statements:
            if name and not self._lacking:
                self._account.hold("materials")
                what = f"material {name!r}, in no library; the default material is used"
                self._account.lose("materials", LEFT_OUT, what)
            return Made(Surface(name or self.obj.stem), assumed=True)
        file, statements = self._statements[name]
        self._account.hold("materials")
        self._account.use("materials")
        return _Material(self, name, file, statements, self._accounts[file]).made()

    def note(self, kind: str, file: Path, what: str) -> None:
        self._notebook.add(kind, file, what)

    def close(self) -> None:
        for account in self._accounts.values():
            account.close()


class _Material:
    """One material from its statements, each of which is used or noted."""

    def __init__(
        self, libraries: Libraries, name: str, file: Path, statements: Statements,
        account: Account,
    ):  # fmt: skip
        self.libraries, self.name, self.file = libraries, name, file
        self.statements, self.account = statements, account
        self.maps = {
            key: Map.parse(text) for key, (_, text) in statements.items()
            if key.startswith("map_") or key in ("norm", "bump", "disp", "decal", "refl")
        }  # fmt: skip
        for word, _ in statements.values():
            account.hold(_called(word))
        self._used: set[str] = set()

    def made(self) -> Made:
        textures = {to: self._picture(key) for key, to in MAPS.items()}
        diffuse = self._numbers("kd", 0.8)
        if textures["texture"] is not None and not diffuse.any():
            diffuse = np.ones(3)  # exporters write Kd 0 0 0 beside a texture and mean the texture
        shininess = float(self._numbers("ns", 0.0)[0])
        specular, emission = self._numbers("ks", 0.0), np.maximum(self._numbers("ke", 0.0), 0)
        if shininess < 1 and specular.any():
            specular = np.zeros(3)
            self._note(LEFT_OUT, "Ks, for it has no exponent Ns of at least 1")
        if textures["emission_texture"] is not None and not emission.any():
            emission = np.ones(3)
        changes: dict[str, Any] = dict(textures)
        if {"pm", "pr"} & self.statements.keys():
            metallic, roughness = (
                self._numbers(key, default, most=1.0)[0]
                for key, default in (("pm", 0.0), ("pr", 0.5))
            )
            changes["metallic"], changes["roughness"] = float(metallic), float(roughness)
            self._used -= {"ks", "ns"}
        if "norm" in self.maps:
            changes["normal_scale"] = self._factor("norm")
        changes |= self._transparency(diffuse, textures["texture"])
        changes["clearcoat"], changes["clearcoat_roughness"] = (
            float(self._numbers(key, 0.0, most=1.0)[0]) for key in ("pc", "pcr")
        )
        diffuse = changes.pop("diffuse", diffuse)
        self._account_for_all()
        surface = Surface(
            self.name, clipped(diffuse), clipped(specular), float(np.clip(shininess, 1, 1000)),
            triple(emission), **changes,
        )  # fmt: skip
        moves = [
            np.concatenate([self.maps[key].triple("-s", 1.0), self.maps[key].triple("-o", 0.0)])
            for key in (*MAPS, "map_d") if key in self._used & self.maps.keys()
        ]  # fmt: skip
        if not moves:
            return Made(surface)
        if any((move != moves[0]).any() for move in moves):
            self._note(APPROXIMATED, "textures moved one by one; all as the first")
        return Made(surface, scale=moves[0][:2], offset=moves[0][2:])

    def _note(self, kind: str, what: str) -> None:
        self.libraries.note(kind, self.file, f"material {self.name!r}: {what}")

    def _numbers(
        self, key: str, otherwise: float, *, least: float = 0.0, most: float = np.inf
    ) -> np.ndarray:
        """(3,) numbers of a statement; a single number stands for all three.

        Unless a range has no end, they must be within it, to rounding.
        """
        self._used.add(key)
        if key not in self.statements:
            return np.full(3, otherwise)
        _, text = self.statements[key]
        text = text.removeprefix("-halo ")
        if text.split()[:1] in (["spectral"], ["xyz"]):
            self._note(LEFT_OUT, f"{key.title()} {text.split()[0]}")
            return np.full(3, otherwise)
        numbers = [_number(word) for word in text.split()]
        where = Where(self.file, f"material {self.name}: {self.statements[key][0]}")
        if len(numbers) not in (1, 3) or None in numbers:
            problem = f"{text!r} is not one finite number or three"
            raise where.error(problem, "Mend the material file")
        values = np.broadcast_to(np.array(numbers, np.float64), 3)
        if not least and np.isinf(most):
            return values
        if not ((values >= least - ROUNDING) & (values <= most + ROUNDING)).all():
            ends = f"from {least:g} on" if np.isinf(most) else f"from {least:g} to {most:g}"
            raise where.error(f"cannot be {text}", f"Give numbers {ends}")
        return np.clip(values, least, most)

    def _factor(self, key: str) -> float:
        words = self.maps[key].options.get("-bm", [])
        return next((number for word in words if (number := _number(word)) is not None), 1.0)

    def _picture(self, key: str, alpha: bool = False) -> np.ndarray | None:
        """(H, W, 3), or 4 with ``alpha``, uint8 of a map's file; None if there is no such map, or,
        with a note, if its file is missing."""
        if key not in self.maps:
            return None
        self._used.add(key)
        map_ = self.maps[key]
        for option in map_.options.keys() & SEEN:
            if map_.options[option] == ["off"] or (option == "-imfchan" and alpha):
                continue
            self._note(APPROXIMATED, f"{SEEN[option]} ({option}) of its texture {map_.name!r}")
        if map_.options.get("-clamp") == ["on"]:
            self._note(APPROXIMATED, "a texture that is clamped; it repeats")
        file = beside(map_.name, self.file, self.libraries.obj)
        if file is None:
            word, _ = self.statements[key]
            self.account.lose(_called(word), LEFT_OUT, f"texture {map_.name!r}, not found")
            self._used.discard(key)
            return None
        codes = read_texture(file, Where(self.file, f"material {self.name}: {key}"), alpha=True)
        if alpha:
            return codes
        if key == "map_kd" and "map_d" not in self.maps and codes[..., 3].min(initial=255) < SOLID:
            self._note(NOT_USED, f"alpha of texture {map_.name!r}, which no map_d asks for")
        return np.ascontiguousarray(codes[..., :3])

    def _transparency(self, diffuse: np.ndarray, texture: np.ndarray | None) -> dict[str, Any]:
        """The fields of veils, of glass, and of holes, where alpha is below a half."""
        opacity = float(self._numbers("d", 1.0, most=1.0)[-1])
        if "tr" in self.statements and "d" not in self.statements:
            opacity = 1 - float(self._numbers("tr", 0.0, most=1.0)[0])
            if not opacity:
                opacity = 1.0
                self._note(ASSUMED, "Tr 1 is opaque, as in old exporters; d 0 is transparent")
        picture = self._picture("map_d", alpha=True)
        alpha = np.full((1, 1), 255, np.uint8)
        if picture is not None:
            channel = self.maps["map_d"].options.get("-imfchan", [""])[0]
            if channel in ("r", "g", "b"):
                alpha = picture[..., "rgb".index(channel)]
            elif channel == "m" or (channel != "l" and picture[..., 3].min() < 255):
                alpha = picture[..., 3]
            else:
                alpha = np.rint(picture[..., :3].mean(-1)).astype(np.uint8)
        least, most = int(alpha.min()) / 255, int(alpha.max()) / 255
        base = WHITE[..., :3] if texture is None else texture
        soft = opacity * least < SOLID / 255 and (opacity < 1 or not is_mask(alpha))
        if soft and opacity * most > 0:
            if least == 1 and int(self._numbers("illum", 2.0)[0]) in REFRACTIVE:
                index = float(self._numbers("ni", 1.0, least=1.0)[0])
                colour = opacity * diffuse + (1 - opacity) * self._numbers("tf", 1.0, most=1.0)
                return {"transmission": 1 - opacity, "ior": index, "diffuse": colour}
            if least == most:
                return {"opacity": opacity * least}
            codes = np.dstack(same_size(base, alpha))
            return {"opacity": opacity, "alpha_blend": True, "texture": codes}
        if opacity * most < 0.5:
            self._note(LEFT_OUT, "cut out wholly")
            return {"texture": np.zeros((1, 1, 4), np.uint8), "alpha_cutoff": 0.5}
        if opacity * least >= 0.5:
            return {}
        codes = np.dstack(same_size(base, alpha))
        return {"texture": codes, "alpha_cutoff": 0.5 / opacity}

    def _account_for_all(self) -> None:
        """Use the statements that were read or only state a default; note the others."""
        for key, (word, text) in self.statements.items():
            values = [_number(word) for word in text.split()]
            if key in self._used or (values and set(values) <= set(PLAIN.get(key, ()))):
                self.account.use(_called(word))


def _called(word: str) -> str:
    return f"statements '{word}'" if re.fullmatch(r"[\w.-]{1,32}", word) else "other statements"
