"""The outcome of an input: accepted, or refused in one line; everything else is a finding."""

import re
import traceback
import unicodedata
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from lfcore.errors import LfcoreError

ROOT = Path(__file__).resolve().parent.parent
SEEDS = ROOT / "robustness" / "seeds"
OK, REFUSED = "ok", "refused"
LONGEST_MESSAGE = 2000
"""The most characters of an error: nobody reads a longer line."""


class SilentlyWrong(Exception):
    """An accepted input had a wrong result."""


@dataclass(frozen=True)
class Outcome:
    """The outcome of an input.

    Attributes
    ----------
    kind : str
        ``ok``, ``refused``, or the kind of finding.
    signature : str
        The same for similar findings.
    text : str
        The message or traceback.
    """

    kind: str
    signature: str = ""
    text: str = ""

    @property
    def is_finding(self) -> bool:
        return self.kind not in (OK, REFUSED)


def outcome_of(work: Callable[[], object], names: str | None) -> Outcome:
    """Run ``work`` and judge its result or exception.

    A refusal must contain ``names``, the name of the input's file; None if the library does not
    know the name.
    """
    try:
        work()
    except LfcoreError as error:
        return judge_message(str(error), names, error)
    except SilentlyWrong as error:
        # Findings that differ only in numbers share a signature.
        return Outcome("silent wrong", re.sub(r"[-+.\d]+", "#", str(error))[:80], str(error))
    except MemoryError as error:
        return Outcome("memory", f"MemoryError {_place(error)}", _last_lines(error))
    except (Exception, SystemExit, KeyboardInterrupt) as error:
        kind = type(error).__name__
        return Outcome("traceback", f"{kind} {_place(error)}", _last_lines(error))
    return Outcome(OK)


def judge_message(text: str, names: str | None, error: BaseException | None = None) -> Outcome:
    """Judge whether ``text`` is a proper refusal: one printable, short line with the name."""
    at = _place(error) if error is not None else text[:40]
    if not text.strip():
        return Outcome("message", f"empty {at}", text)
    # Cc: control characters, Zl and Zp: line separators, Cs: halves of characters.
    bad = {unicodedata.category(letter) for letter in text} & {"Cc", "Zl", "Zp", "Cs"}
    if bad:
        return Outcome("message", f"not one printable line {at}", ascii(text[:1000]))
    if len(text) > LONGEST_MESSAGE:
        return Outcome("message", f"{LONGEST_MESSAGE} characters and more {at}", text[:1000])
    if names is not None and names not in text:
        return Outcome("message", f"does not name the file {at}", text)
    return Outcome(REFUSED, "", text)


def _place(error: BaseException) -> str:
    """Return file and function of the project's innermost frame, outside the harness."""
    place = ""
    for frame, _ in traceback.walk_tb(error.__traceback__):
        path = Path(frame.f_code.co_filename)
        if path.is_relative_to(ROOT) and path.parts[len(ROOT.parts)] in ("lfcore", "workflow"):
            place = f"{path.relative_to(ROOT)}:{frame.f_code.co_name}"
    return f"in {place or 'the harness'}"


def _last_lines(error: BaseException) -> str:
    # The traceback of a RecursionError has thousands of frames.
    return "".join(traceback.format_exception(error, limit=-6, chain=False))[-2000:]
