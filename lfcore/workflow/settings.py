"""The configuration: checked against its keys and completed before the first job.

``python -m lfcore.workflow.settings`` writes what is made from the keys: the schema, the default
configuration and the table of config/README.md.
"""

from __future__ import annotations

import functools
import operator
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pydantic
import yaml

from lfcore.errors import SettingsError, did_you_mean
from lfcore.files import write_text
from lfcore.workflow.keys import DEFAULT_SCENES, Configuration

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
    known = {name for one in (schema(), *schema()["$defs"].values()) for name in one["properties"]}
    within = [part for part in above if isinstance(part, int) or part in known]
    if kind in UNKNOWN:
        name = last if kind == "extra_forbidden" else first["input"]
        there = list(_at(within)[0]["properties"])
        return SettingsError(
            "unknown key", key=_dotted([*within, name]), remedy=did_you_mean(str(name), there)
        )
    if kind == MISSING:
        return SettingsError(f"{last!r} is a required property", key=_dotted(within))
    place = [*within, last] if isinstance(last, int) or last in known else within
    _, key = _at(place)
    meant = [key["description"], values_of(key)] if key.get("description") else []
    remedy = f"Expected: {'; '.join(filter(None, meant))}" if meant else None
    return SettingsError(_problem(first), key=_dotted(place), remedy=remedy)


def _dotted(place: list) -> str:
    return f"configuration: {'.'.join(map(str, place))}" if place else "configuration"


def _at(place: list) -> tuple[dict, dict]:
    """The mapping of keys at a place, and the last key on the way there, as in the schema."""
    mapping, key = schema(), {}
    for name in place:
        if name in mapping["properties"]:
            key = mapping["properties"][name]
            mapping = _mapping(key) or mapping
    return mapping, key


def _mapping(key: dict) -> dict:
    """The mapping of keys that a key holds: itself, in a list, by name, or as an alternative."""
    if "$ref" in key:
        return schema()["$defs"][key["$ref"].rpartition("/")[2]]
    parts = (key.get("items"), key.get("additionalProperties"), *key.get("anyOf", ()))
    return next(filter(None, map(_mapping, filter(None, parts))), {})


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


@functools.cache
def schema() -> dict[str, Any]:
    """The JSON schema of the configuration."""
    made = _untitled(Configuration.model_json_schema())
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **made}


def _untitled(part: Any) -> Any:
    """Of a schema without the titles that pydantic makes of names."""
    if isinstance(part, list):
        return [_untitled(one) for one in part]
    if not isinstance(part, dict):
        return part
    titled = isinstance(part.get("title"), str)
    return {k: _untitled(one) for k, one in part.items() if not (titled and k == "title")}


def values_of(key: Mapping) -> str:
    """What a key admits, in words, by its schema."""
    if "anyOf" in key:
        return ", or ".join(filter(None, map(values_of, key["anyOf"])))
    if "const" in key or "enum" in key:
        return ", ".join(f"`{one}`" for one in key.get("enum", [key.get("const")]))
    kind = key.get("type", "")
    if kind == "array":
        least, most = key.get("minItems", 0), key.get("maxItems")
        several = f"{least}" if most == least else f"{least} to {most}"
        if most is None:
            several = "list of" if least < 2 else f"{least} or more"
        return f"{several} {_plural(values_of(key['items']))}"
    if kind == "object":
        return ": ".join(filter(None, ("by name", values_of(key["additionalProperties"]))))
    if kind in ("integer", "number"):
        return _range("whole number" if kind == "integer" else "number", key)
    return {"boolean": "`true`, `false`", "string": "text"}.get(kind, "")


def _plural(values: str) -> str:
    """Of one item's values those of several."""
    if values[:1].isdigit():  # lists of lists
        return f"lists of {values}"
    return re.sub(r"^(whole number|number|text)\b", r"\1s", values) or "mappings"


def _range(kind: str, key: Mapping) -> str:
    if {"minimum", "maximum"} <= set(key):
        return f"{kind}, {key['minimum']} to {key['maximum']}"
    low = f"{kind} above {key['exclusiveMinimum']}" if "exclusiveMinimum" in key else kind
    return f"{low} and below {key['exclusiveMaximum']}" if "exclusiveMaximum" in key else low


def leaves(mapping: Mapping, above: str = "") -> Iterator[tuple[str, dict]]:
    """Every key that is no mapping of keys, in order: its name with dots, and its schema."""
    for name, key in mapping["properties"].items():
        if "$ref" in key:
            yield from leaves(_mapping(key), f"{above}{name}.")
        else:
            yield f"{above}{name}", key


def defaults() -> dict:
    """The default configuration."""
    return check_settings({"scenes": list(DEFAULT_SCENES)})


def table(mapping: Mapping, default: Mapping) -> str:
    """The keys of a schema as a Markdown table: meaning, values, default."""
    lines = ["| key | meaning | values | default |", "|---|---|---|---|"]
    for name, key in leaves(mapping):
        value = functools.reduce(operator.getitem, name.split("."), default)
        meaning = key["description"]
        lines.append(f"| `{name}` | {meaning} | {values_of(key)} | {_default(key, value)} |")
    return "\n".join(lines)


def _default(key: Mapping, value: Any) -> str:
    if value is ...:
        return "required"
    if value is None:
        return "the lens's" if "lens's own" in key["description"] else "`null`"
    if value == "":
        return "empty"
    if isinstance(value, list) and value == key["items"].get("enum"):
        return "all"
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return ", ".join(str(part["name"]) for part in value)
    return f"`{_flow(value)}`"


def _flow(value: Any) -> str:
    text = yaml.safe_dump(value, default_flow_style=True, width=10**6, sort_keys=False)
    return text.removesuffix("\n").removesuffix("\n...")


OF_SCHEMA = "# Made by `make settings`.\n"
OF_DEFAULTS = """\
# The default run, made by `make settings`. Keys are explained in config/README.md; any can be
# overridden: snakemake --cores 2 --config spatial_resolution=64 -- results/tables/
"""


def documents(root: Path) -> dict[Path, str]:
    """The text of every file that is made from the keys."""
    plane = schema()["$defs"]["Plane"]
    of_plane = {name: key.get("default", ...) for name, key in plane["properties"].items()}
    tables = {"keys": table(schema(), defaults()), "planes": table(plane, of_plane)}

    def dump(data: dict[str, Any]) -> str:
        return yaml.safe_dump(
            data, sort_keys=False, default_flow_style=None, width=100, allow_unicode=True
        )

    readme = root / "config" / "README.md"
    text = readme.read_text(encoding="utf-8")
    text = re.sub(
        r"(<!-- (keys|planes) -->\n).*?(<!-- end of \2 -->)",
        lambda found: f"{found[1]}\n{tables[found[2]]}\n\n{found[3]}",
        text,
        flags=re.DOTALL,
    )
    return {
        root / "workflow" / "schemas" / "config.schema.yaml": f"{OF_SCHEMA}{dump(schema())}",
        root / "config" / "config.yaml": f"{OF_DEFAULTS}{dump(defaults())}",
        readme: text,
    }


def main(root: Path = Path()) -> None:
    for path, text in documents(root).items():
        write_text(path, text)
        print(path)


if __name__ == "__main__":
    main()
