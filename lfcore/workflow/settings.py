"""The configuration, checked against its keys and completed.

``python -m lfcore.workflow.settings`` writes the files that are generated from the keys: the
schema, the default configuration, and the tables of config/README.md.  ``--check`` lists
stale ones.
"""

import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pydantic
import yaml

from lfcore.checked_keys import refusal
from lfcore.datasets.description import Description
from lfcore.errors import SettingsError
from lfcore.files import write_text
from lfcore.workflow import keys
from lfcore.workflow.keys import Configuration

ROOT = Path(__file__).resolve().parents[2]
COMMAND = "`python -m lfcore.workflow.settings`"


def check_settings(config: Mapping, **where: Any) -> dict:
    """Return a copy of ``config`` with all defaults.

    Raises :class:`SettingsError` that names the key, for an unknown key or an impossible value.
    ``where`` has the error's ``file`` and the ``key`` that holds the mapping.
    """
    where = where or {"key": "configuration"}
    try:
        return Configuration.model_validate(dict(config)).model_dump()
    except pydantic.ValidationError as error:
        raise refusal(Configuration, error, **where) from None
    except RecursionError:
        raise SettingsError("is nested too deeply", **where) from None


def schema() -> dict[str, Any]:
    """Return the JSON schema of the configuration."""
    draft = "https://json-schema.org/draft/2020-12/schema"
    return {"$schema": draft, **Configuration.model_json_schema()}


def rows(model: type[pydantic.BaseModel], above: str = "") -> Iterator[str]:
    """Yield a model's keys as rows of a Markdown table: name with dots, meaning, default."""
    for name, field in model.model_fields.items():
        default = field.get_default(call_default_factory=True)
        if isinstance(default, pydantic.BaseModel):
            yield from rows(type(default), f"{above}{name}.")
        else:
            shown = "required" if field.is_required() else f"`{_flow(default)}`"
            yield f"| `{above}{name}` | {field.description} | {shown} |"


def _flow(value: Any) -> str:
    text = yaml.safe_dump(value, default_flow_style=True, width=10**6, sort_keys=False)
    return text.removesuffix("\n").removesuffix("\n...")


def commented(model: type[keys.Keys], indent: str = "") -> Iterator[str]:
    """Yield a model's default values as lines of YAML, each below its meaning."""
    for name, field in model.model_fields.items():
        default = field.get_default(call_default_factory=True)
        yield f"{indent}# {field.description}"
        if isinstance(default, keys.Keys):
            yield f"{indent}{name}:"
            yield from commented(type(default), f"{indent}  ")
        else:
            yield f"{indent}{name}: {_flow(default)}"


def documents() -> dict[Path, str]:
    """Return the text of every file that is generated from the keys."""
    texts = {ROOT / "config/config.yaml": "\n".join(commented(Configuration)) + "\n"}
    text = yaml.safe_dump(
        schema(), sort_keys=False, default_flow_style=None, width=100, allow_unicode=True
    )
    texts[ROOT / "workflow/schemas/config.schema.yaml"] = f"# Written by {COMMAND}.\n{text}"
    readme = ROOT / "config/README.md"
    models: dict[str, type[pydantic.BaseModel]] = {
        "keys": Configuration, "planes": keys.Plane, "dataset": Description,
    }  # fmt: skip
    head = "| key | meaning | default |\n|---|---|---|\n"
    texts[readme] = re.sub(
        r"(<!-- (keys|planes|dataset) -->\n).*?(<!-- end of \2 -->)",
        lambda match: f"{match[1]}\n{head}{chr(10).join(rows(models[match[2]]))}\n\n{match[3]}",
        readme.read_text(encoding="utf-8"),
        flags=re.DOTALL,
    )
    return texts


def main() -> None:
    check, stale = "--check" in sys.argv, []
    for path, text in documents().items():
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            stale.append(path)
            if not check:
                write_text(path, text)
    for path in stale:
        print(f"{path}: {f'stale; run {COMMAND}' if check else 'written'}")
    sys.exit(bool(check and stale))


if __name__ == "__main__":
    main()
