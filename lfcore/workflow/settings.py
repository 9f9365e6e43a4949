"""The configuration: checked against its keys and completed before the first job.

``python -m lfcore.workflow.settings`` writes what is made from the keys: the schema, the default
configuration and the table of config/README.md.
"""

from __future__ import annotations

import difflib
import re
import types
import typing
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pydantic
import yaml

from lfcore.errors import LfcoreError
from lfcore.files import write_text
from lfcore.workflow.key_types import Keys
from lfcore.workflow.keys import DEFAULT_SCENES, Configuration, Plane

MISSING = "missing"
UNKNOWN = ("extra_forbidden", "invalid_key")
DEEPEST = 32
MOST_VALUES = 100_000
_BOUNDS = {
    "greater_than_equal": ("ge", "is less than the minimum of"),
    "less_than_equal": ("le", "is greater than the maximum of"),
    "greater_than": ("gt", "is not greater than"),
    "less_than": ("lt", "is not less than"),
}


class SettingsError(LfcoreError):
    """A configuration that names no run."""


def check_settings(config: Mapping) -> dict:
    """A copy of ``config`` with every default filled in.

    Raises
    ------
    SettingsError
        for unknown keys and impossible values; it names the key and says what is admitted.
    """
    _check_extent(config)
    try:
        return Configuration.model_validate(dict(config)).model_dump()
    except pydantic.ValidationError as error:
        raise _explain(error) from None


def _check_extent(config: Mapping) -> None:
    """Neither too deep nor, once aliases are followed, too many values: few lines may mean both."""
    values = 0

    def check(value: object, key: str, above: tuple[int, ...]) -> None:
        nonlocal values
        values += 1
        problem = ""
        if id(value) in above:
            problem = "contains itself"
        elif len(above) > DEEPEST:
            problem = f"is nested more than {DEEPEST} deep"
        elif values > MOST_VALUES:
            problem = f"holds more than {MOST_VALUES} values"
        if problem:
            raise SettingsError(problem, key=key[:200], remedy="Write the values out")
        if isinstance(value, (Mapping, list)):
            parts = value.items() if isinstance(value, Mapping) else enumerate(value)
            for name, part in parts:
                check(part, f"{key}.{name}", (*above, id(value)))

    check(config, "configuration", ())


def _explain(error: pydantic.ValidationError) -> SettingsError:
    """The error that lies deepest; of alternatives, the one that the value nearly fits."""
    first = max(error.errors(), key=_fit)
    kind, (*above, last) = first["type"], first["loc"]
    known = set(_names(Configuration))
    within = [part for part in above if isinstance(part, int) or part in known]
    if kind in UNKNOWN:
        name = last if kind == "extra_forbidden" else first["input"]
        there = list(_at(within)[0].model_fields)
        close = difflib.get_close_matches(str(name), there, 1)
        hint = f"Did you mean {close[0]!r}" if close else f"Known are {', '.join(there)}"
        return SettingsError("unknown key", key=_dotted([*within, name]), remedy=hint)
    if kind == MISSING:
        return SettingsError(f"{last!r} is a required property", key=_dotted(within))
    place = [*within, last] if isinstance(last, int) or last in known else within
    _, field = _at(place)
    meant = [field.description, values_of(field)] if field and field.description else []
    remedy = f"Expected: {'; '.join(filter(None, meant))}" if meant else None
    return SettingsError(_problem(first), key=_dotted(place), remedy=remedy)


def _dotted(place: list) -> str:
    return f"configuration: {'.'.join(map(str, place))}" if place else "configuration"


def _at(place: list) -> tuple[type[Keys], pydantic.fields.FieldInfo | None]:
    """The mapping of keys at a place, and the last key on the way there."""
    model: type[Keys] = Configuration
    field = None
    for name in place:
        if name in model.model_fields:
            field = model.model_fields[name]
            model = next(models(field.annotation), model)
    return model, field


def _fit(error: Mapping) -> tuple:
    exact = error["type"] in (*_BOUNDS, *UNKNOWN, MISSING)
    return (
        len([part for part in error["loc"] if isinstance(part, int)]),
        exact,
        len(error["loc"]),
        error["type"] != "literal_error",
    )


def _problem(error: Mapping) -> str:
    shown = repr(error["input"])
    shown = shown if len(shown) < 80 else f"{shown[:80]}..."
    if error["type"] in _BOUNDS:
        name, words = _BOUNDS[error["type"]]
        return f"{shown} {words} {error['ctx'][name]}"
    words = error["msg"][0].lower() + error["msg"][1:]
    return f"{shown} {words}" if words.startswith(("is ", "has ")) else f"{shown}: {words}"


def models(annotation: Any) -> Iterator[type[Keys]]:
    """The models of keys within a type."""
    if isinstance(annotation, type) and issubclass(annotation, Keys):
        yield annotation
    for part in typing.get_args(annotation):
        yield from models(part)


def _names(model: type[Keys]) -> Iterator[str]:
    for name, field in model.model_fields.items():
        yield name
        for inner in models(field.annotation):
            yield from _names(inner)


def values_of(field: pydantic.fields.FieldInfo) -> str:
    """What a key admits, in words: from its type and bounds."""
    return _values(field.annotation, field.metadata)


def _values(annotation: Any, metadata: tuple | list = ()) -> str:
    if typing.get_origin(annotation) is typing.Annotated:
        inner, *more = typing.get_args(annotation)
        more = [part for field in more for part in getattr(field, "metadata", [field])]
        return _values(inner, [*more, *metadata])
    bounds = {
        name: getattr(part, name)
        for part in metadata
        for name in ("ge", "le", "gt", "lt", "min_length", "max_length")
        if hasattr(part, name)
    }
    origin, parts = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is typing.Literal:
        return ", ".join(f"`{part}`" for part in parts)
    if origin in (typing.Union, types.UnionType) and _is_number(parts):
        return _values(parts[1])
    if origin in (typing.Union, types.UnionType):
        return ", or ".join(filter(None, (_values(part) for part in parts)))
    if origin is list:
        least, most = bounds.get("min_length", 0), bounds.get("max_length")
        several = f"{least}" if most == least else f"{least} to {most}"
        if most is None:
            several = "list of" if least < 2 else f"{least} or more"
        return f"{several} {_plural(_values(parts[0]))}"
    if origin is dict:
        inner = _values(parts[1])
        return f"by name: {inner}" if inner else "by name"
    if annotation in (int, float):
        return _range("whole number" if annotation is int else "number", bounds)
    return {bool: "`true`, `false`", str: "text"}.get(annotation, "")


def _plural(values: str) -> str:
    """Of one item's values those of several."""
    if values[:1].isdigit():  # lists of lists
        return f"lists of {values}"
    return re.sub(r"^(whole number|number|text)\b", r"\1s", values) or "mappings"


def _is_number(parts: tuple) -> bool:
    return [getattr(part, "__origin__", part) for part in parts] == [int, float]


def _range(kind: str, bounds: dict) -> str:
    if {"ge", "le"} <= set(bounds):
        return f"{kind}, {bounds['ge']} to {bounds['le']}"
    low = f"{kind} above {bounds['gt']}" if "gt" in bounds else kind
    return f"{low} and below {bounds['lt']}" if "lt" in bounds else low


def leaves(model: type[Keys] = Configuration, above: str = "") -> Iterator[tuple[str, Any]]:
    """Every key that is no mapping of keys, in order: its name with dots, and its field."""
    for name, field in model.model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, Keys):
            yield from leaves(field.annotation, f"{above}{name}.")
        else:
            yield f"{above}{name}", field


def defaults() -> dict:
    """The default configuration."""
    return check_settings({"scenes": list(DEFAULT_SCENES)})


def table(model: type[Keys] = Configuration) -> str:
    """The keys as a Markdown table: meaning, values, default."""
    lines = ["| key | meaning | values | default |", "|---|---|---|---|"]
    for name, field in leaves(model):
        default = field.get_default(call_default_factory=True)
        if name == "scenes":
            default = list(DEFAULT_SCENES)
        lines.append(
            f"| `{name}` | {field.description} | {values_of(field)} | {_default(field, default)} |"
        )
    return "\n".join(lines)


def _default(field: pydantic.fields.FieldInfo, value: Any) -> str:
    if field.is_required() and not isinstance(value, list):
        return "required"
    if value is None:
        return "the lens's" if "lens's own" in (field.description or "") else "`null`"
    if value == "":
        return "empty"
    if isinstance(value, list) and len(value) > 2 and all(isinstance(part, str) for part in value):
        offered = values_of(field)
        if all(f"`{part}`" in offered for part in value):
            return "all"
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return ", ".join(str(part["name"]) for part in value)
    return f"`{_flow(value)}`"


def _flow(value: Any) -> str:
    text = yaml.safe_dump(value, default_flow_style=True, width=10**6, sort_keys=False)
    return text.removesuffix("\n").removesuffix("\n...")


def documents(root: Path) -> dict[Path, str]:
    """The text of every file that is made from the keys."""
    schema = _untitled(Configuration.model_json_schema())
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}

    def dump(data: dict[str, Any]) -> str:
        return yaml.safe_dump(
            data, sort_keys=False, default_flow_style=None, width=100, allow_unicode=True
        )

    def filled(found: re.Match[str]) -> str:
        model = Configuration if found[3] == "keys" else Plane
        return f"{found[1]}\n{table(model)}\n\n{found[2]}"

    readme = root / "config" / "README.md"
    text = readme.read_text(encoding="utf-8")
    text = re.sub(
        r"(<!-- (?:keys|planes) -->\n).*?(<!-- end of (keys|planes) -->)", filled, text,
        flags=re.DOTALL,
    )  # fmt: skip
    return {
        root / "workflow" / "schemas" / "config.schema.yaml": "# Made by `make settings`.\n"
        + dump(schema),
        root
        / "config"
        / "config.yaml": "# The default run, made by `make settings`. Keys are explained"
        " in config/README.md; any can be\n# overridden: snakemake --cores 2 --config"
        " spatial_resolution=64 -- results/tables/\n" + dump(defaults()),
        readme: text,
    }


def _untitled(schema: Any) -> Any:
    """A schema without the titles that pydantic makes of names."""
    if isinstance(schema, list):
        return [_untitled(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    titled = isinstance(schema.get("title"), str)
    return {k: _untitled(part) for k, part in schema.items() if not (titled and k == "title")}


def main(root: Path = Path()) -> None:
    for path, text in documents(root).items():
        write_text(path, text)
        print(path)


if __name__ == "__main__":
    main()
