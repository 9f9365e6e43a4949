"""The configuration: checked against its schema and completed before the first job."""

from __future__ import annotations

import copy
import difflib
import functools
from collections.abc import Mapping
from pathlib import Path

import jsonschema
import yaml

from lfcore.errors import LfcoreError

SCHEMA_FILE = Path(__file__).with_name("schemas") / "config.schema.yaml"


class SettingsError(LfcoreError):
    """A configuration that names no run."""


@functools.cache
def read_schema() -> dict:
    """The JSON schema (2020-12) of the configuration; not to be changed."""
    return yaml.safe_load(SCHEMA_FILE.read_text(encoding="utf-8"))


def check_settings(config: Mapping) -> dict:
    """A copy of ``config`` with every default filled in.

    Raises
    ------
    SettingsError
        for unknown keys and impossible values; it names the key and says what is admitted.
    """
    schema = read_schema()
    settings = _complete(_typed(dict(config), schema), schema)
    validator = jsonschema.Draft202012Validator(schema)
    errors = sorted(validator.iter_errors(settings), key=lambda error: list(map(str, error.path)))
    if errors:
        raise _explain(errors[0])
    return settings


def _typed(value: object, schema: Mapping) -> object:
    """A copy of ``value`` in which texts are numbers, truth values or null where these are meant.

    Snakemake hands over what is within lists and mappings of ``--config`` as text.
    """
    if isinstance(value, Mapping):
        parts = schema.get("properties", {})
        return {key: _typed(item, parts.get(key, {})) for key, item in value.items()}
    if isinstance(value, list):
        options = [schema, *schema.get("oneOf", [])]
        items = next((option["items"] for option in options if "items" in option), {})
        return [_typed(item, items) for item in value]
    if isinstance(value, str) and schema:
        if value == "null" and "null" in schema.get("type", ()):
            return None
        if not jsonschema.Draft202012Validator(schema).is_valid(value):
            try:
                meant = yaml.safe_load(value)
            except yaml.YAMLError:
                return value
            # 'off' or '2026-01-01' where a name is wanted is a wrong name, not a wrong type.
            return meant if isinstance(meant, (bool, int, float)) else value
    return value


def _complete(value: object, schema: Mapping) -> object:
    if isinstance(value, dict):
        for key, part in schema.get("properties", {}).items():
            if "default" in part and key not in value:
                value[key] = copy.deepcopy(part["default"])
            if key in value:
                value[key] = _complete(value[key], part)
    return value


def _fit(error: jsonschema.ValidationError) -> tuple[int, bool]:
    """The deeper the mistake, the closer the value came; a wrong kind of value came least."""
    return len(error.absolute_path), error.validator not in ("const", "type", "enum")


def _explain(error: jsonschema.ValidationError) -> SettingsError:
    # Of a list of alternatives, speak of the one that the value nearly fits.
    while error.context:
        error = max(error.context, key=_fit)
    key = ".".join(str(part) for part in error.absolute_path)
    if error.validator == "additionalProperties":
        known = list(error.schema["properties"])
        unknown = sorted(set(error.instance) - set(known))[0]
        close = difflib.get_close_matches(unknown, known, 1)
        return SettingsError(
            "unknown key",
            key=f"configuration: {key}.{unknown}" if key else f"configuration: {unknown}",
            remedy=f"Did you mean {close[0]!r}" if close else f"Known are {', '.join(known)}",
        )
    expected = error.schema.get("description")
    return SettingsError(
        error.message,
        key=f"configuration: {key}" if key else "configuration",
        remedy=f"Expected: {' '.join(expected.split()).rstrip('.')}" if expected else None,
    )
