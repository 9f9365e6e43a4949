"""How much there is to read in the tracer's kernels, and on the way of one block.

    python benchmarks/count_kernels.py        (make count)

The way of a block is found, not listed: from the kernel ``trace_packets`` on, every function, macro
and type that the text of another names, and the files that define them.  BESIDE names what a block
of opaque, matte, plain, unshadowed triangles whose rays are traced together never enters.
"""

import re
from pathlib import Path

from lfcore.tracing.layouts import SINKS

ROOT = Path(__file__).resolve().parents[1]
LIBRARY = ROOT / "lfcore"
KERNELS = LIBRARY / "tracing" / "kernels"
HOST = (
    "tracing/tracer.py", "tracing/packets.py", "optics/bundles.py", "tracing/job.py",
    "tracing/layouts.py",
)  # fmt: skip
"""The host's files, in the order in which a tile passes them.  Not listed: what is made once per
scene (hierarchy, surfaces, buffers, the C header), the plan, a tile's places, cuts and memory, and
arrays, which are another sink."""
ENTRY, BEGIN = "trace.cl", "trace_packets"
BESIDE = {
    "other sinks": {"Arrays", "write_arrays", "hit_given_rays"},
    "blocks of several elements": {"spread_colours"},
    "shadows": {"find_lit", "Shadows", "ShadowMemory", "OccluderCache"},
    "holes": {"has_holes", "is_solid", "stopped_rays", "CutOuts"},
    "rays one by one": {"follow_packet", "ray_overlaps", "sweep_overlaps", "Ray", "Sweep"},
    "textures": {"read_maps", "set_up_texture", "map_row", "patch_row", "read_patch",
                 "TexelPatch"},
    "highlights": {"highlight"},
    "baked light": {"look_up_light", "fit_regions",
                    "sky_row", "reflect_sky"},
    "light above white": {"encode_pq"},
    "attributes of corners": {"set_up_attributes", "interpolate_attributes", "turn_to_viewer"},
    "blocks whose colours vary little": {"make_cubic"},
    "packets of one element": {"start_compaction", "compact_candidates", "Compaction",
                               "CompactedLeaves"},
    "sensor planes": {"add_view", "add_to_strip", "finish_strip", "drop_closed_blocks",
                      "SensorPlanes", "Strip"},
    "microfacets": {"read_row_maps", "reflect_light", "is_metallic",
                    "ambient_reflectance"},
}  # fmt: skip
MOST_COLUMNS, MOST_LINES, MOST_PARAMETERS = 100, 50, 7


def sources() -> dict[Path, str]:
    return {path: path.read_text(encoding="ascii") for path in sorted(KERNELS.rglob("*.cl"))}


def functions(text: str) -> list[tuple[str, int, str]]:
    """The name, the number of parameters and the text of each function of a file."""
    pattern = r"^(?:inline|KERNEL|kernel) [^;{=]*?(\w+)\(([^{;]*?)\)\s*\{(?: [^\n]*\}$|.*?\n\})"
    found = re.finditer(pattern, text, re.MULTILINE | re.DOTALL)
    return [(m[1], m[2].count(",") + 1, m[0]) for m in found]


def definitions(text: str) -> dict[str, str]:
    """The text of every function, macro and type of a file, by name."""
    text = re.sub(r"//[^\n]*", "", text)
    found = {name: body for name, _, body in functions(text)}
    for macro in re.finditer(r"^#define (\w+)(?:[^\n]*\\\n)*[^\n]*", text, re.MULTILINE):
        if not macro[1].startswith("LFCORE_"):
            found[macro[1]] = found.get(macro[1], "") + macro[0]
    for type_ in re.finditer(r"^typedef struct \w*\s*\{[^}]*\} (\w+);", text, re.MULTILINE):
        found[type_[1]] = type_[0]
    for enum in re.finditer(r"^enum \{([^}]*)\};", text, re.MULTILINE):
        found |= dict.fromkeys(re.findall(r"\b[A-Z]\w*", enum[1]), enum[0])
    return found


def way_of_a_block() -> list[Path]:
    """The kernel files that define what a block passes: the entry, then each after its includes."""
    texts = sources()
    named = {path.name: path for path in texts}
    included: list[Path] = []

    def include(path: Path) -> None:
        for name in re.findall(r'#include "(.*)"', texts[path]):
            if named[name] not in included:
                include(named[name])
        included.append(path)

    include(named[ENTRY])
    where: dict[str, list[tuple[Path, str]]] = {}
    for path in included:
        for name, body in definitions(texts[path]).items():
            where.setdefault(name, []).append((path, body))
    beside = set().union(*BESIDE.values())
    missing = (beside | {BEGIN}) - where.keys()
    if missing:
        raise SystemExit(f"no such functions or types any more: {', '.join(sorted(missing))}")
    files: set[Path] = set()
    seen, open_ = set(beside), [BEGIN]
    while open_:
        name = open_.pop()
        if name in seen:
            continue
        seen.add(name)
        for path, body in where[name]:
            files.add(path)
            # Local variables may be called like functions, not like macros and types.
            words = dict.fromkeys(re.findall(r"\w+(?= *\()|[A-Z]\w+|\bsample\b", body))
            open_ += [word for word in reversed(words) if word in where and word not in seen]
    return [named[ENTRY]] + [path for path in included if path in files and path.name != ENTRY]


def defines() -> list[str]:
    """Names that programs are built with, as the host's sources have them."""
    texts = (path.read_text(encoding="utf-8") for path in (LIBRARY / "tracing").glob("*.py")
             if path.name != "layouts.py")  # fmt: skip
    found = {"LANES"}.union(*(re.findall(r'"([A-Z][A-Z_]+)": ', text) for text in texts))
    return sorted(found - SINKS.keys())


def main() -> None:
    texts = sources()
    lines = [line for text in texts.values() for line in text.splitlines()]
    found = [one for text in texts.values() for one in functions(text)]
    way = [LIBRARY / name for name in HOST] + way_of_a_block()
    size = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in way}
    counts = {
        "kernel files": len(texts),
        "kernel lines": len(lines),
        "conditionals": sum(bool(re.match(r"\s*#\s*if", line)) for line in lines),
        "host defines": len(defines()),
        f"lines over {MOST_COLUMNS} columns": sum(len(line) > MOST_COLUMNS for line in lines),
        f"functions over {MOST_LINES} lines": sum(f[2].count("\n") >= MOST_LINES for f in found),
        f"functions over {MOST_PARAMETERS} parameters": sum(f[1] > MOST_PARAMETERS for f in found),
        "files on the way of a block": len(way),
        "lines of these files": sum(size.values()),
    }
    for name, count in counts.items():
        print(f"{count:6}  {name}")
    print("defines:", ", ".join(defines()))
    print("the way of a block:")
    for path, count in size.items():
        print(f"{count:6}  {path.relative_to(LIBRARY)}")


if __name__ == "__main__":
    main()
