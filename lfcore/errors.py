"""Errors that a user can act on: what is wrong, where, and the remedy."""

import difflib
import functools
import inspect
import unicodedata
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

Error = TypeVar("Error", bound="LfcoreError")
Named = TypeVar("Named", bound=Callable[..., Any])

LONGEST_TEXT = 1000
"""Characters of an error: one line that can still be read."""


class LfcoreError(Exception):
    """Base of every error that lfcore raises on bad input.

    The command line and the workflow's scripts print ``str(error)`` alone, without a traceback, and
    exit with status 1.

    Parameters
    ----------
    problem : str
        What is wrong, one sentence without a full stop.
    file : str or Path, optional
        The file it was found in.
    key : str, optional
        The key, element or option within that file, such as ``camera.focus_m``.
    remedy : str, optional
        What to do about it, one sentence without a full stop.
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
        end = f". {remedy}." if remedy else "."
        super().__init__(one_line(text) + printable(end))

    def named(
        self, kind: type[Error], *, file: str | Path | None = None, key: str | None = None
    ) -> Error:
        """Make an error of another kind from this one, with its problem and remedy.

        ``file`` and ``key`` take the place of this error's.
        """
        return kind(self.problem, file=file or self.file, key=key or self.key, remedy=self.remedy)


def did_you_mean(unknown: str, known: Iterable[str]) -> str:
    """The remedy for a name that is not among ``known``: the one most like it, or all."""
    known = list(known)
    near = difflib.get_close_matches(unknown, known, n=1)
    return f"Did you mean {near[0]!r}" if near else f"Known are {', '.join(known) or 'none'}"


def check_known(
    kind: type[Error], key: str, value: object, known: Iterable[str], what: str | None = None
) -> None:
    """Raise an error of this kind for a value that is none of the known ones."""
    names = list(known)
    if value not in names:
        remedy = f"Use one of {', '.join(names)}"
        raise kind(f"unknown {what or key} {value!r}", key=key, remedy=remedy)


def check_kind(
    value: object, kind: Any, key: str, what: str | None = None, *, remedy: str | None = None
) -> None:
    """Raise an error for a value of another class than ``kind``."""
    if not isinstance(value, kind):
        what = what or f"a {kind.__name__}"
        raise LfcoreError(f"must be {what}, not {value!r}", key=key, remedy=remedy)


def suggest_keywords(call: Named) -> Named:
    """Decorate a function or dataclass: errors on unknown keywords suggest the nearest one."""
    function: Any = vars(call)["__init__"] if isinstance(call, type) else call
    known = [name for name in inspect.signature(function).parameters if name not in ("self", "cls")]

    @functools.wraps(function)
    def checked(*arguments: Any, **keywords: Any) -> Any:
        for name in keywords.keys() - known:
            problem = f"{call.__name__}() got an unexpected keyword argument {name!r}"
            raise TypeError(f"{problem}. {did_you_mean(name, known)}")
        return function(*arguments, **keywords)

    if not isinstance(call, type):
        return checked  # type: ignore[return-value]
    call.__init__ = checked  # type: ignore[misc]
    return call


def one_line(text: str) -> str:
    """``text`` as one printable line of at most some :data:`LONGEST_TEXT` characters."""
    text = printable(text)
    if len(text) <= LONGEST_TEXT:
        return text
    # Both ends: the place, and the reason.
    return f"{text[: LONGEST_TEXT * 2 // 3]} ... {text[-(LONGEST_TEXT // 3) :]}"


def printable(text: str) -> str:
    """``text`` on one line: names and values from files may hold anything, a terminal's codes too.

    Line ends, control characters and halves of surrogate pairs appear as escapes.
    """
    if text.isprintable():
        return text
    # Marks that change the direction of writing (Cf) would show the line in another order.
    bad = ("Cc", "Cf", "Cs", "Zl", "Zp")
    return "".join(
        ascii(letter)[1:-1] if unicodedata.category(letter) in bad else letter for letter in text
    )


class SceneError(LfcoreError):
    """A scene that cannot be read or makes no sense."""


class OpticsError(LfcoreError):
    """A lens, slab or sensor plane that cannot exist."""


class DeviceError(LfcoreError):
    """No OpenCL device, or one that cannot do what is asked."""


class SettingsError(LfcoreError):
    """A configuration that names no run."""


class StorageError(LfcoreError):
    """A light field file that is damaged, foreign or contradicts itself."""
