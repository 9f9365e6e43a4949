"""Every command that README, help and tutorials show, on models that nobody here made them for."""

import contextlib
import functools
import http.server
import re
import shlex
import webbrowser
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

import lfcore
from lfcore.cli import EPILOG, main, parser
from lfcore.colour import srgb_encode
from robustness.outcome import ROOT

pytestmark = pytest.mark.slow

PIXELS = 48
SCENE = re.compile(
    r"(example|scenes/\w+(/\w+\.yaml)?|(table|model)\.glb|both\.yaml|mesh\.stl|scene\.pbrt|table)"
)
FOREIGN = re.compile(
    r"https?://|--serve|\|\||array\.exr|chess\.mkv|(boxes|shots|views)/ |lfcore dataset "
    r"|--frames|(walk|ball|moving)\.mkv"
)
"""Inputs of other programs, which are tested in tests/exchange and test_imgtool.py, servers,
what is to be refused, data sets, which take no model, and films, whose models move
(test_film.py)."""
READERS = ("refocus", "stack", "view", "info", "depth", "export")
SMALLER = {"--pixels": str(PIXELS), "--views": "5", "--subpixels": "1", "--quality-db": "32"}
PARSER = parser()


def posts(size: float, up: str = "y") -> trimesh.Trimesh:
    """Four posts and a ball among them, each farther than the one to its left, on no floor."""
    boxes = [
        trimesh.creation.box((0.14, 1.0, 0.14)).apply_translation((x, 0, -2.2 * x))
        for x in (-1, -0.5, 0.5, 1)
    ]
    ball = trimesh.creation.icosphere(2, 0.6)
    mesh = trimesh.util.concatenate([*boxes, ball]).apply_scale(size)
    if up == "z":
        mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    return mesh


def metres_with_camera(folder: Path) -> Path:
    scene = trimesh.Scene(posts(1))
    scene.camera = trimesh.scene.Camera("camera", resolution=(64, 64), fov=(40, 40))
    scene.camera_transform = trimesh.transformations.translation_matrix((0, 0.3, 6))
    scene.export(folder / "metres.glb")
    return folder / "metres.glb"


def pbrt_with_camera(folder: Path) -> Path:
    mesh = posts(100)
    points, corners = (
        " ".join(map(str, np.ravel(each))) for each in (mesh.vertices * [1, 1, -1], mesh.faces)
    )
    (folder / "centimetres.pbrt").write_text(
        "LookAt 0 30 -600  0 0 0  0 1 0\n"
        'Camera "perspective" "float fov" [40]\nFilm "image" "integer xresolution" [48] '
        '"integer yresolution" [48]\nSampler "random" "integer pixelsamples" [4]\nWorldBegin\n'
        'LightSource "distant" "point from" [-3 4 -5] "rgb L" [2 2 2]\n'
        f'Shape "trianglemesh" "integer indices" [{corners}] "point P" [{points}]\n'
    )
    return folder / "centimetres.pbrt"


def exported(name: str, size: float, up: str):
    def write(folder: Path) -> Path:
        posts(size, up).export(folder / name)
        return folder / name

    return write


BARE, TURNED = ["--bare"], ["--bare", "--up", "z"]
MODELS: dict[str, tuple[Callable[[Path], Path], list[str]]] = {
    "metres.glb": (metres_with_camera, BARE),
    "millimetres.obj": (exported("millimetres.obj", 0.02, "y"), BARE),
    "up.ply": (exported("up.ply", 1, "z"), TURNED),
    "kilometres.stl": (exported("kilometres.stl", 1500, "z"), TURNED),
    "centimetres.pbrt": (pbrt_with_camera, BARE),
    "on_a_floor.glb": (exported("on_a_floor.glb", 1, "y"), []),
}
"""How to write each model, and its options: sharpness is measured before a dark background."""


@pytest.fixture(scope="module", autouse=True)
def once():
    """Options are set up, and each model is read and its tree built, once for all commands."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lfcore.cli, "parser", lambda words: PARSER)
        patch.setattr(lfcore, "load_scene", functools.cache(lfcore.load_scene))
        yield


class Model:
    """A model, what is seen of it, and its default light field."""

    def __init__(self, name: str, folder: Path):
        write, self.options = MODELS[name]
        self.done: list[list[str]] = []
        self.path = write(folder)
        up, self.bare = "z" if "z" in self.options else None, "--bare" in self.options
        scene = lfcore.load_scene(self.path, up=up, bare=self.bare)
        self.near, self.far = scene.depth_range
        self.lens_m = scene.camera.focal_length_m / scene.camera.f_number
        self.field = folder / "default.mkv"
        said = ["record", str(self.path), *self.options, "-o", str(self.field)]
        assert main([*said, "--pixels", str(PIXELS)]) == 0
        # The lens all but closed: everything is sharp.
        self.sharp = lfcore.render(scene, pixels=PIXELS, f_number=64 * scene.camera.f_number)
        depth = ["depth", str(self.path), *self.options, "--pixels", str(PIXELS)]
        assert main([*depth, "-o", str(folder / "depth.npz")]) == 0
        self.depth = np.load(folder / "depth.npz")["depth_m"][0]

    def metres(self, text: str) -> str:
        """A distance between 1 m and 10 m of the text, as one between what is near and far here."""
        share = np.clip(np.log10(float(text)), 0, 1)
        return f"{self.near * (self.far / self.near) ** share:.9g}"

    def distance(self, focus: str) -> float:
        return {"near": self.near, "far": self.far}.get(focus) or float(focus)


@pytest.fixture(scope="module")
def model(request, tmp_path_factory, once):
    return Model(request.param, tmp_path_factory.mktemp("model"))


def shown(text: str) -> list[str]:
    """The commands of a text, without the words beside them, which two spaces part."""
    joined = text.replace("\\\n", " ")
    found = (line.strip() for line in joined.splitlines())
    commands = (re.split(r"\s{2,}", line)[0] for line in found if line.startswith("lfcore "))
    return [one for one in commands if "COMMAND" not in one and not FOREIGN.search(f"{one} ")]


@functools.cache
def texts() -> dict[str, str]:
    fences = re.compile(r"^```(?:bash)?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
    found = {"lfcore": EPILOG}
    commands = next(one for one in PARSER._actions if hasattr(one, "choices") and one.choices)
    for name, command in commands.choices.items():
        found[f"lfcore {name}"] = command.epilog or ""
    for path in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]:
        page = path.read_text(encoding="utf-8")
        if path.stem == "README" or "\n<!-- run" in page:
            found[path.stem] = "\n".join(fences.findall(page))
    return {name: text for name, text in found.items() if shown(text)}


def adapted(command: str, model: Model) -> list[str]:
    """Words of a command with the model in place of its scene, at few pixels."""
    words, made, option = shlex.split(command, comments=True)[1:], [], ""
    for word in words:
        if re.match(r"-+[a-z]", word):
            option = word
        if option == "--from" and model.path.suffix == ".pbrt":
            continue  # its camera stays where it is
        if word == option:
            pass
        elif SCENE.fullmatch(word):
            word = str(model.path)
        elif option in SMALLER:
            word = SMALLER[option] if _number(word) else "3x3"
        elif option == "--baseline":
            word = f"{model.lens_m / 8:.9g}m"
        elif option == "--view" and word.endswith("mm"):
            word = f"{float(word[:-2]) * 5 * model.lens_m:.9g}mm"
        elif option in ("--focus", "--focus-range", "--refocus") and _number(word):
            word = model.metres(word)
        word = re.sub(r"(?<=focus=)[\d.]+", lambda found: model.metres(found[0]), word)
        made += [re.sub(r"^\d+views$", "3views", word)]
        made += model.options if word == str(model.path) and words[0] != "info" else []
    if words[0] in ("record", "render", "plenoptic") and "--pixels" not in words:
        made += ["--pixels", str(PIXELS)]
    return made


def is_default(words: list[str], model: Model) -> bool:
    """Whether a command makes the file that is there already."""
    plain = ["record", str(model.path), *model.options, "-o", "--pixels", SMALLER["--pixels"]]
    return [word for word in words if not word.endswith(".mkv")] == plain


def _number(word: str) -> bool:
    return bool(re.fullmatch(r"-?\d+(\.\d+)?", word))


PAIRS = [
    (name, text) for m, name in enumerate(MODELS) for t, text in enumerate(texts()) if (m + t) % 2
]


@pytest.mark.parametrize(("model", "place"), PAIRS, indirect=["model"])
def test_every_command_that_is_shown_works_on_any_model(place, model, tmp_path, monkeypatch):
    """A text's commands on every other model: most commands are in several texts."""
    opened = []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(webbrowser, "open", opened.append)
    monkeypatch.setattr(http.server.ThreadingHTTPServer, "serve_forever", lambda self: None)
    Path("planes.csv").write_text("focus,f_number,aperture\nnear,2.8,circle\nfar,5.6,square\n")
    Path("singlet.dat").write_text("50 6 1.5168 30 64.2\n-50 3 1 30 0\n0 45 1 20 0\n")
    for command in shown(texts()[place]):
        words = adapted(command, model)
        for word in words:
            if word.endswith(".mkv") and (is_default(words, model) or words[0] in READERS):
                with contextlib.suppress(FileExistsError):
                    Path(word).symlink_to(model.field)
        if is_default(words, model):
            continue
        opened.clear()
        output = words[words.index("-o") + 1] if "-o" in words else None
        same = [word for word in words if word != output and not Path(word).is_symlink()]
        if output and output.endswith(".png") and same in model.done:
            continue  # on another page, too
        model.done.append(same)
        assert main(words) == 0, command
        if output and output.endswith((".png", ".npy", ".exr")):
            check(words, Path(output), model, place)
        if words[0] == "view" and output is None:
            assert opened, command


def check(words: list[str], output: Path, model: Model, place: str) -> None:
    """Pictures are not blank; at one focus, what is there is sharp, and what is not is blurred."""
    files = [output] if output.exists() else sorted(Path().glob(f"{output.stem}_*{output.suffix}"))
    assert files, words
    for file in files:
        if file.suffix == ".png":
            picture = cv2.imread(str(file))[..., ::-1] / 255
            assert picture.std() > 0.02 or "--macropixel" in words, words
    alone = words[0] in ("render", "refocus") and len(files) == 1 and output.suffix == ".png"
    focus = words[words.index("--focus") + 1] if "--focus" in words else ""
    blurred = bool({"--f-number", "--blur", "--views", "--from"} & set(words))
    elsewhere = output.stem == "ghosts" or place in ("stanford", "hci-ground-truth")
    if blurred or elsewhere or not (alone and model.bare):
        return
    if focus in ("near", "far") or _number(focus):
        inside, beyond = blurs(picture, model, model.distance(focus))
        assert inside < 0.7 * beyond and beyond > 0.01, (words, inside, beyond)


def blurs(picture: np.ndarray, model: Model, focus: float) -> tuple[float, float]:
    """Differences from the sharp picture at edges: near the focus, and far from it."""
    sharp = srgb_encode(np.clip(model.sharp, 0, 1))
    edge = cv2.morphologyEx(sharp.mean(2), cv2.MORPH_GRADIENT, np.ones((3, 3)))
    # An edge has the depth of what is nearer.
    nearest = cv2.erode(model.depth, np.ones((5, 5)))
    seen = nearest < 2 * model.far
    off = np.abs(1 / nearest - 1 / focus)
    most = off[seen].max()
    apart = np.abs(picture - sharp).mean(2) * edge
    near, far = seen & (off < 0.3 * most), seen & (off > 0.6 * most)
    return tuple(float(apart[where].sum() / edge[where].sum()) for where in (near, far))
