"""The corpus: inputs that once were findings. Every run begins with them."""

import hashlib
import re
from collections.abc import Callable
from pathlib import Path

from robustness.outcome import Outcome

CORPUS = Path(__file__).with_name("corpus")


def kept(target: str) -> list[Path]:
    folder = CORPUS / _slug(target)
    return sorted(path for path in folder.glob("*") if path.is_file()) if folder.is_dir() else []


def keep(target: str, data: bytes, signature: str) -> Path:
    """Write an input to the corpus; its name says what was wrong."""
    folder = CORPUS / _slug(target)
    folder.mkdir(parents=True, exist_ok=True)
    digest = hashlib.sha256(data).hexdigest()[:8]
    path = folder / f"{_slug(signature)[:60]}-{digest}"
    path.write_bytes(data)
    return path


def _slug(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")


def smaller(data: bytes, still: Callable[[bytes], Outcome], signature: str, tries: int) -> bytes:
    """A shorter input with the same finding: we leave out pieces as long as the finding stays.

    Delta debugging without its complements: Zeller, Hildebrandt, "Simplifying and Isolating
    Failure-Inducing Input", IEEE TSE 2002.
    """
    size = len(data) // 2
    while size >= 1 and tries > 0:
        at = 0
        while at < len(data) and tries > 0:
            shorter = data[:at] + data[at + size :]
            tries -= 1
            if still(shorter).signature == signature:
                data = shorter
            else:
                at += size
        size //= 2
    return data
