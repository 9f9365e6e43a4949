"""What may come of an input: it is taken, or refused in one line; all else is a finding."""

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
"""Characters of an error: more is no line that anybody reads."""


class SilentlyWrong(Exception):
    """An input that was taken and gave what it must not give."""


@dataclass(frozen=True)
class Outcome:
    """``kind`` is ``ok``, ``refused`` or what was found; findings alike share a ``signature``."""

    kind: str
    signature: str = ""
    text: str = ""

    @property
    def is_finding(self) -> bool:
        return self.kind not in (OK, REFUSED)


def outcome_of(work: Callable[[], object], names: str | None) -> Outcome:
    """Run ``work`` and judge how it ends.

    ``names`` must be in the text of a refusal (the name of the input's file); None where the
    library does not know it.
    """
    try:
        work()
    except LfcoreError as error:
        return judge_message(str(error), names, error)
    except SilentlyWrong as error:
        # The same with other numbers is the same.
        return Outcome("silent wrong", re.sub(r"[-+.\d]+", "#", str(error))[:80], str(error))
    except MemoryError as error:
        return Outcome("memory", f"MemoryError {_place(error)}", _last_lines(error))
    except (Exception, SystemExit, KeyboardInterrupt) as error:
        kind = type(error).__name__
        return Outcome("traceback", f"{kind} {_place(error)}", _last_lines(error))
    return Outcome(OK)


def judge_message(text: str, names: str | None, error: BaseException | None = None) -> Outcome:
    """Whether ``text`` is a proper refusal: one printable line of bearable length with the name."""
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
    """File and function of the innermost frame of the project, not of the harness."""
    place = ""
    for frame, _ in traceback.walk_tb(error.__traceback__):
        path = Path(frame.f_code.co_filename)
        if path.is_relative_to(ROOT) and path.parts[len(ROOT.parts)] in ("lfcore", "workflow"):
            place = f"{path.relative_to(ROOT)}:{frame.f_code.co_name}"
    return f"in {place or 'the harness'}"


def _last_lines(error: BaseException) -> str:
    # A limit: the traceback of an error of depth has thousands of frames.
    return "".join(traceback.format_exception(error, limit=-6, chain=False))[-2000:]
