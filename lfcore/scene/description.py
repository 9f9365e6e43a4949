"""Reading and checking scene.yaml: a plain dictionary comes out, with every default filled in."""

import functools
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import yaml

from lfcore.errors import SceneError, did_you_mean
from lfcore.reading import Where

# The integers of 64 bits: numpy turns larger ones into objects, or fails.
LARGEST_INTEGER = 2**63 - 1
SCHEMA_PATH = Path(__file__).with_name("scene.schema.yaml")


@functools.cache
def schema() -> dict:
    """The JSON schema (2020-12) of scene.yaml."""
    return yaml.load(SCHEMA_PATH.read_text(encoding="utf-8"), yaml.CSafeLoader)


def check(description: Any, *, file: str | Path) -> dict:
    """Return ``description`` if the schema accepts it and all its numbers are finite."""
    import jsonschema  # mesh files do without

    where = Where(file)
    if not isinstance(description, dict):
        remedy = "Start with 'objects:' and a list of '- file: mesh.glb'"
        raise where.error("a scene is a mapping with the key 'objects'", remedy)
    _check_finite(description, where)
    validator = jsonschema.Draft202012Validator(schema())
    errors = sorted(validator.iter_errors(description), key=lambda e: [str(p) for p in e.path])
    if errors:
        raise _explain(jsonschema.exceptions.best_match(errors[:1]), where)
    return description


def complete(description: dict) -> dict:
    """Fill in the schema's defaults, recursively; the input is not changed."""
    result = _with_defaults({"camera": {}, **description}, schema())
    for entry in result["objects"]:
        entry.setdefault("materials", {})
        entry.setdefault("parameters", {})
    return result


def _with_defaults(value: Any, rule: dict) -> Any:
    if "$ref" in rule:
        rule = {**schema()["$defs"][rule["$ref"].removeprefix("#/$defs/")], **rule}
    if rule.get("type") == "integer" and isinstance(value, float):
        return int(value)  # JSON schema takes 1.0 for an integer; random generators do not
    if isinstance(value, dict):
        properties = dict(rule.get("properties", {}))
        for option in rule.get("oneOf", []):
            keys = option.get("properties", {})
            if keys and set(value) <= set(keys):
                properties.update(keys)
        result = {k: _with_defaults(v, properties.get(k, {})) for k, v in value.items()}
        for key, sub in properties.items():
            if key not in result and "default" in sub:
                result[key] = sub["default"]
        return result
    if isinstance(value, list) and isinstance(rule.get("items"), dict):
        return [_with_defaults(item, rule["items"]) for item in value]
    return value


def _check_finite(value: Any, where: Where) -> None:
    # YAML's .nan and .inf are numbers to the schema; here they are mistakes.
    if isinstance(value, float) and not math.isfinite(value):
        raise where.error(f"{value} is not a finite number", "Give a finite one")
    if isinstance(value, int) and abs(value) > LARGEST_INTEGER:
        raise where.error(f"a number of {value.bit_length()} bits", "Give a lesser one")
    items: Iterable[tuple[Any, Any]] = value.items() if isinstance(value, dict) else ()
    if isinstance(value, list):
        items = enumerate(value)
    for name, item in items:
        _check_finite(item, where[name])


def _explain(error: Any, where: Where) -> SceneError:
    for name in error.absolute_path:
        where = where[name]
    rule, value, kind = error.schema, error.instance, error.validator
    if kind == "additionalProperties":
        keys = list(rule.get("properties", {}))
        unknown = min(map(str, set(value) - set(keys)))
        return where[unknown].error("unknown key", did_you_mean(unknown, keys))
    if kind == "required":
        missing = next(k for k in error.validator_value if k not in value)
        return where.error(f"key {missing!r} is missing", "Add it")
    if kind == "not" and isinstance(value, dict):
        first, second = error.validator_value["required"]
        return where[second].error(f"excludes {first}", "Leave one out")
    if kind == "oneOf" and isinstance(value, dict):
        names = [" and ".join(option.get("required", [])) for option in error.validator_value]
        problem = f"needs exactly one of {', '.join(name for name in names if name)}"
        return where.error(problem, "Give one of them")
    if kind == "minItems" and where.key == "objects":
        return where.error("the scene is empty", "List a mesh file or a builder")
    owner = error
    while "description" not in owner.schema and owner.parent is not None:
        owner = owner.parent
    remedy = owner.schema.get("description")
    if remedy:
        remedy = "Expected: " + " ".join(remedy.split()).rstrip(".")
    if kind == "oneOf":
        return where.error(f"{value!r} is not allowed here", remedy)
    return where.error(" ".join(error.message.split()), remedy)
