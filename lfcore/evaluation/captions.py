"""Captions: reStructuredText with Jinja expressions, the form that Snakemake's reports take."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace

import docutils.core
import jinja2


def fill(text: str, config: Mapping[str, object]) -> str:
    """``text`` with its Jinja expressions filled in; they see ``snakemake.config``.

    Raises
    ------
    jinja2.UndefinedError
        for a name that is not there.
    """
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, autoescape=False)
    return environment.from_string(text).render(snakemake=SimpleNamespace(config=config))


def to_html(text: str, config: Mapping[str, object]) -> str:
    """HTML of a filled-in caption, without raw HTML or included files.

    Raises
    ------
    docutils.utils.SystemMessage
        for reStructuredText with a mistake.
    """
    parts = docutils.core.publish_parts(
        fill(text, config),
        writer="html5",
        settings_overrides={
            "report_level": 2,
            "halt_level": 2,
            "raw_enabled": False,
            "file_insertion_enabled": False,
        },
    )
    return parts["body"]
