"""Errors that a user can act on: what is wrong, where, and the remedy."""

from __future__ import annotations

from pathlib import Path


class LfcoreError(Exception):
    """Base of every error that lfcore raises on bad input.

    The command line and the workflow scripts print ``str(error)`` alone, without a traceback,
    and exit with status 1.

    Parameters
    ----------
    problem : what is wrong, one sentence without a full stop.
    file : the file it was found in.
    key : the key, element or option within that file, e.g. ``camera.focus_distance_m``.
    remedy : what to do about it, one sentence without a full stop.
    """

    def __init__(
        self,
        problem: str,
        *,
        file: str | Path | None = None,
        key: str | None = None,
        remedy: str | None = None,
    ):
        self.problem, self.file, self.key, self.remedy = problem, file, key, remedy
        place = ": ".join(str(part) for part in (file, key) if part)
        text = f"{place}: {problem}" if place else problem
        super().__init__(f"{text}. {remedy}." if remedy else f"{text}.")


class SceneError(LfcoreError):
    """A scene that cannot be read or makes no sense."""


class OpticsError(LfcoreError):
    """A lens, slab or sensor plane that cannot exist."""


class DeviceError(LfcoreError):
    """No OpenCL device, or one that cannot do what is asked."""


class StorageError(LfcoreError):
    """A light field file that is damaged, foreign or contradicts itself."""
