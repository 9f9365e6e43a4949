"""The card of a data set, tables of items, refusals and meshes, and Croissant metadata; its page.

The page has a contact sheet, histograms and refusals.

Source: Croissant 1.0, https://docs.mlcommons.org/croissant/docs/croissant-spec.html
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from lfcore import __version__
from lfcore.datasets.description import Description
from lfcore.datasets.items import DEPTH_BINS
from lfcore.datasets.kinds import BLUR_BINS
from lfcore.datasets.stored import StoredItem, stored_items
from lfcore.errors import SceneError
from lfcore.evaluation.figures import save_figure
from lfcore.evaluation.page import Section, write_page
from lfcore.files import file_digest, read_json, write_json
from lfcore.pictures import contact_sheet, write_picture
from lfcore.rendering.depth import depth_picture

CONTEXT = Path(__file__).with_name("croissant_context.json")
ITEMS = {
    "index": ("sc:Integer", "number of the scene"),
    "split": ("sc:Text", "train, validation or test"),
    "expected_db": ("sc:Float", "PSNR in dB, sRGB, that is expected of the worst picture"),
    "rays_per_pixel": ("sc:Float", "rays traced per pixel, of all pictures together"),
    "seen": ("sc:Float", "share of the picture that objects fill"),
    "nearest_m": ("sc:Float", "least depth"),
    "farthest_m": ("sc:Float", "greatest depth"),
    "objects": ("sc:Text", "shapes, separated by spaces"),
}
SECONDS = {
    "index": ("sc:Integer", "number of the scene"),
    "seconds": ("sc:Float", "wall seconds"),
    "core_seconds": ("sc:Float", "processor seconds of all threads"),
    "scene_core_seconds": ("sc:Float", "of these, to draw the scene and build its hierarchy"),
    "files_core_seconds": ("sc:Float", "of these, to encode files"),
}
REFUSED = {
    "index": ("sc:Integer", "number of the scene"),
    "reason": ("sc:Text", "why it made no item"),
}
SOURCES = {
    "shape": ("sc:Text", "mesh file, or procedural shape"),
    "source": ("sc:Text", "path, or the program that made it"),
    "licence": ("sc:Text", "licence and source of a mesh, as its owner has them"),
    "sha256": ("sc:Text", "checksum of a mesh file"),
    "objects": ("sc:Integer", "how often it was placed"),
    "problem": ("sc:Text", "why a mesh was left out, with the next one in its place"),
}
RECORDS = {"items": ITEMS, "seconds": SECONDS, "refused": REFUSED, "sources": SOURCES}
"""The tables and their columns."""
MOST_REFUSED = 0.1
"""The greatest share of scenes without an item: a scene's camera may miss its objects."""
DFV_TRAINS_ON = 400
"""The number of stacks that DFV's loader trains on (dataloader/FoD500.py)."""
MEDIA = {
    ".tif": "image/tiff", ".exr": "image/x-exr", ".png": "image/png", ".tar": "application/x-tar",
    ".pfm": "application/octet-stream", ".mat": "application/x-matlab-data",
    ".h5": "application/x-hdf5", ".npy": "application/octet-stream", ".npz": "application/zip",
    ".mkv": "video/x-matroska",
}  # fmt: skip

AS_BYTES = "text/plain"
"""The format that mlcroissant reads as bytes; it reads TIFF wrongly as floats, and of the others
only PNG."""


def tables(
    description: Description, records: Sequence[Mapping[str, Any]], data: Path
) -> dict[str, pd.DataFrame]:
    """Return the tables by name; ``data`` is the folder of items.

    Times have a table of their own, so that equal data sets have equal other tables.
    """
    complete = [record for record in records if "refused" not in record]
    refused = [{"index": record["index"], "reason": record["refused"]} for record in records
               if "refused" in record]  # fmt: skip
    items = [
        {"nearest_m": record["depth_m"][0], "farthest_m": record["depth_m"][1]}
        | {key: record[key] for key in ("index", "expected_db", "rays_per_pixel", "seen")}
        | {"split": description.split(record["index"])}
        | {"objects": " ".join(name.replace(" ", "_") for name in record["objects"])}
        for record in complete
    ]
    uses = [name for record in complete for name in record["objects"]]
    problems = {name: text for record in complete for name, text in record["dropped"].items()}
    sources = [
        {"shape": file.name, "source": str(file), "licence": description.licence_of(file),
         "sha256": file_digest(file), "objects": uses.count(file.name),
         "problem": problems.get(file.name)}
        for file in description.mesh_files()
    ] + [
        {"shape": name, "source": f"lfcore {__version__}", "licence": "MIT",
         "objects": uses.count(name)} for name in description.shapes.builders
    ]  # fmt: skip
    files = [
        {"file": file.relative_to(data).as_posix(), "bytes": file.stat().st_size,
         "sha256": file_digest(file)} for file in sorted(data.rglob("*")) if file.is_file()
    ]  # fmt: skip
    return {
        "items": pd.DataFrame(items, columns=list(ITEMS)),
        "seconds": pd.DataFrame(records, columns=list(SECONDS)),
        "refused": pd.DataFrame(refused, columns=list(REFUSED)),
        "sources": pd.DataFrame(sources, columns=list(SOURCES)),
        "files": pd.DataFrame(files, columns=["file", "bytes", "sha256"]),
    }


def check_refused(records: Sequence[Mapping[str, Any]]) -> None:
    """Raise :class:`SceneError` if more than :data:`MOST_REFUSED` of the scenes have no item."""
    refused = [record["refused"] for record in records if "refused" in record]
    if len(refused) > MOST_REFUSED * len(records):
        first = refused[0].removesuffix(".")
        raise SceneError(
            f"{len(refused)} of {len(records)} scenes made no item, the first: {first}",
            key="dataset", remedy="The data set of an earlier run, if any, was left as it is",
        )  # fmt: skip


def write_card(
    path: str | Path, description: Description, files: Mapping[str, Path], *, command: str,
    code: str,
) -> None:  # fmt: skip
    """Write Croissant's JSON-LD for the tables' ``files``, which are in the card's folder."""
    objects = [
        {"@type": "cr:FileObject", "@id": file.name, "name": file.name, "contentUrl": file.name,
         "encodingFormat": "text/csv", "sha256": file_digest(file)} for file in files.values()
    ]  # fmt: skip
    suffixes = {Path(name).suffix for name in pd.read_csv(files["files"])["file"]}
    kinds = sorted(kind[1:] for kind in suffixes & set(MEDIA))
    sets = [
        {"@type": "cr:FileSet", "@id": f"{kind}-files", "name": f"{kind}-files",
         "includes": [f"data/*.{kind}", f"data/**/*.{kind}"],
         "encodingFormat": MEDIA[f".{kind}"] if kind == "png"
         else [AS_BYTES, MEDIA[f".{kind}"]]} for kind in kinds
    ]  # fmt: skip
    items = pd.read_csv(files["items"])
    worst = items["expected_db"].min() if len(items) else float("nan")
    card = {
        "@context": read_json(CONTEXT), "@type": "sc:Dataset", "name": description.name,
        "conformsTo": "http://mlcommons.org/croissant/1.0", "version": "1.0.0",
        "license": description.licence or "unknown",
        "description": f"{len(items)} {description.kind.replace('_', ' ')} of {description.pixels} "
        f"pixels, seed {description.seed}, traced by lfcore {code}, with "
        f"`{command}`. The worst picture is expected to be {worst:.1f} dB to the true one; the "
        "expectation for each item is in items.csv, checksums in files.csv, meshes and their "
        "licences in sources.csv. "
        f"{_properties(description)}{_kind_note(description)}",
        "distribution": [*objects, *sets],
        "recordSet": [*(_table_records(*table) for table in RECORDS.items()),
                      *map(_file_records, kinds)],
    }  # fmt: skip
    write_json(path, card)


def _properties(description: Description) -> str:
    properties = description.properties().items()
    texts = (f"{name.replace('_', ' ')}: {value}" for name, value in properties)
    return f"All pictures have {'; '.join(texts)}."


def _kind_note(description: Description) -> str:
    """Return a note for readers of this kind of data set."""
    if description.kind != "focal_stacks" or description.scenes.train == DFV_TRAINS_ON:
        return ""
    return (f" DFV's loader takes items from {DFV_TRAINS_ON} on as validation, whatever items.csv "
            "says.")  # fmt: skip


def _table_records(table: str, columns: Mapping[str, tuple[str, str]]) -> dict[str, Any]:
    """Return Croissant's record set of a table, one record per row."""
    return {"@type": "cr:RecordSet", "@id": table, "name": table, "field": [
        {"@type": "cr:Field", "@id": f"{table}/{name}", "name": f"{table}/{name}",
         "dataType": kind, "description": meaning,
         "source": {"fileObject": {"@id": f"{table}.csv"}, "extract": {"column": name}}}
        for name, (kind, meaning) in columns.items()
    ]}  # fmt: skip


def _file_records(kind: str) -> dict[str, Any]:
    """Return Croissant's record set of a kind of file: path, item and content."""
    fields: dict[str, tuple[str, str, dict]] = {
        "file": ("sc:Text", "the file's path", {"extract": {"fileProperty": "fullpath"}}),
        "index": (
            "sc:Integer", "number of the scene",
            {"extract": {"fileProperty": "fullpath"}, "transform": {"regex": r".*?(\d{6})"}},
        ),
        "content": (
            "sc:ImageObject" if kind in ("tif", "png") else "sc:Text", "what the file holds",
            {"extract": {"fileProperty": "content"}},
        ),
    }  # fmt: skip
    if kind == "tar":  # a shard has many items
        del fields["index"]
    return {"@type": "cr:RecordSet", "@id": kind, "name": kind, "field": [
        {"@type": "cr:Field", "@id": f"{kind}/{name}", "name": f"{kind}/{name}",
         "dataType": type, "description": meaning,
         "source": {"fileSet": {"@id": f"{kind}-files"}, **source}}
        for name, (type, meaning, source) in fields.items()
    ]}  # fmt: skip


SHOWN = 25
"""The items on the contact sheet."""
DEPTHS = ("depth.exr", "depth_m.exr", "gt_depth_lowres.pfm", "depth.npy")
"""The fields with the first picture's depth, one per kind of data set."""
SHARP = ("sharp.tif", "image_all_in_focus.png", "right.png")
"""The pictures that the contact sheet leaves out."""
CAPTIONS = {
    "page": "What training sees. A scene that looks odd is a mistake: please report its number.",
    "items": "Per item the first picture, the last one, and depth: near is warm, evenly in 1/m.",
    "spread": "Over all pixels of all items, and the expected PSNR of the worst picture per item.",
    "refused": "Scenes that made no item; all others are at least of the quality asked for.",
    "sources": "Meshes and procedural shapes, and meshes that cannot be read.",
}


def drawn(description: Description, records: Sequence[Mapping[str, Any]]) -> list[int]:
    """Draw the numbers of the items on the contact sheet; return them sorted."""
    indices = [record["index"] for record in records if "refused" not in record]
    rng = np.random.default_rng(description.seed)
    return sorted(rng.permutation(indices)[:SHOWN].tolist())


def write_report(
    page: Path, description: Description, records: Sequence[Mapping[str, Any]],
    shards: Sequence[str | Path], tables: Mapping[str, Path], facts: Mapping[str, object],
) -> None:  # fmt: skip
    """Write the page, ``index.html``, and its figures into the folder ``page`` beside it."""
    folder = page.parent / "page"
    cells, labels = [], []
    for item in map(StoredItem.first, stored_items(shards, drawn(description, records))):
        names = [name for name in item.pictures() if name not in SHARP]
        depth = item.floats(next(name for name in DEPTHS if name in item.files))
        pictures = item.shown(names[0]), item.shown(names[-1]), depth_picture(depth)
        width, height = description.size.scaled(160)
        small = [cv2.resize(p, (width, height), interpolation=cv2.INTER_AREA) for p in pictures]
        cells.append(np.hstack(small))
        labels.append(f"{item.index:06d}: {item.record['expected_db']:.1f} dB")
    spread = _histograms(folder / "spread.png", description, records)
    sections = [
        Section("spread", "Depth, blur and quality", CAPTIONS["spread"], figures={"": spread}),
        Section("refused", "Refused scenes", CAPTIONS["refused"], table=tables["refused"]),
        Section("sources", "Shapes", CAPTIONS["sources"], table=tables["sources"]),
    ]
    if cells:
        sheet = folder / "contact_sheet.png"
        write_picture(sheet, contact_sheet(np.stack(cells), 3, 6, labels))
        items = Section("items", "Items drawn at random", CAPTIONS["items"], figures={"": sheet})
        sections = [items, *sections]
    write_page(
        page, sections, title=f"Data set {description.name}", introduction=CAPTIONS["page"],
        facts=facts, config={},
    )  # fmt: skip


def _histograms(
    path: Path, description: Description, records: Sequence[Mapping[str, Any]]
) -> Path:  # fmt: skip
    complete = [record for record in records if "refused" not in record]
    blurs = np.sum([record["blurs"] for record in complete if "blurs" in record], axis=0)
    figure = Figure((10, 3), layout="constrained")
    axes = figure.subplots(1, 2 + np.ndim(blurs))
    depths = np.sum([record["depths"] for record in complete], axis=0) if complete else np.zeros(40)
    axes[0].stairs(depths / max(depths.sum(), 1), DEPTH_BINS, fill=True)
    axes[0].set(xscale="log", xlabel="depth, m", ylabel="share of pixels")
    if np.ndim(blurs):  # light fields have no blur
        axes[1].stairs(blurs / max(blurs.sum(), 1), BLUR_BINS, fill=True)
        axes[1].set(xlabel="blur radius, px", yscale="log")
    axes[-1].hist([record["expected_db"] for record in complete], 20)
    axes[-1].axvline(description.quality_db, color="black", linewidth=1)
    axes[-1].set(xlabel="expected PSNR, dB", ylabel="items")
    save_figure(path, figure)
    return path
