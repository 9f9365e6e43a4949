"""Values that often break programs."""

import math
from random import Random

NUMBERS = (
    0, -0.0, 1, -1, 2, 0.5, 1e-3, 5e-324, 1e-300, 1e-45, 1e-38, 1.2e-38, 1e-7, 1e7, 1e18, 1e19,
    1e20, 1e36, 1e38, 3.4028235e38, 3.5e38, 1e39, 1e154, 1e155, 1e300, 1e308, -1e308, -1e38, -1e36,
    math.inf, -math.inf, math.nan, 127, 128, 255, 256, 65535, 65536, 200_000, 10**6, 10**7,
    2**31 - 1, 2**31, 2**32, 2**53 + 1, 2**63 - 1, 2**63, 2**64, -(2**31), -(2**63), 10**30,
    10**400, 360, 180, 90, 1e-16, 1 + 2**-52, 1.0, 16777217,
)  # fmt: skip
NUMBER_TEXTS = (
    "1e400", "-1e400", "1e-400", "nan", "inf", "-inf", ".nan", ".inf", "-.INF", "NaN", "Infinity",
    "-0", "+1", "1.", ".5", "1e5", "1E+5", "0x10", "0o17", "0b11", "1_000", "1:30", "01", "1e",
    "--1", "1,5", "1e99999", "9" * 400, "9" * 5000, "0." + "0" * 400 + "1", "1/0", "10%", "1e+",
    "\u0661\u0662", "\U0001d7cf", "1\u00a0000", "0xffffffffffffffff", "1d5", "1f", "4294967296",
)  # fmt: skip
TEXTS = (
    "", " ", "\0", "a\0b", "\n", "a\nb", "\r\n", "\t", "\x1b[31m", "\u2028", "\u202e", "\ufeff",
    "\ud800", "\U0010ffff", "\u00e9\u00df", "..", "../..", "/", "//", "/dev/null", "/dev/zero",
    "/dev/stdin", "/dev/tty", "/proc/self/mem", "/proc/self/fd/0", "~", "~root", "$HOME", "`id`",
    "$(id)", "%s%n", "{0}", "{x!r}", "{", "*", "?", "-", "--", "-o", "con", "nul.png", ".",
    "a" * 300, "a" * 70_000, "a/" * 2000, "true", "null", "None", "nan", "1", "0", "scene.yaml", "file:///x",
    "http://127.0.0.1:1/x.png", "data:,x", "fifo", "folder", "self", "x.obj", "x.png", "x.exr",
    "unreadable", "\\", '"', "'", "#", "#000000", "#zzzzzz", "infinity", "Infinity",
)  # fmt: skip


def number(draw: Random) -> int | float:
    """Draw an extreme number, or one near a power of two or ten."""
    if draw.random() < 0.7:
        return draw.choice(NUMBERS)
    base = draw.choice((2, 10)) ** draw.randrange(0, 64 if draw.random() < 0.5 else 20)
    return draw.choice((1, -1)) * draw.choice((base, base - 1, base + 1, float(base), 1 / base))


def number_text(draw: Random) -> str:
    """Draw the text of a number in a file, or a text that looks like one."""
    if draw.random() < 0.4:
        return draw.choice(NUMBER_TEXTS)
    value = number(draw)
    return str(value) if abs(value) < 1e300 or isinstance(value, float) else "9" * 401


def text(draw: Random) -> str:
    """Draw a text that is special to some program."""
    return draw.choice(TEXTS)


def scalar(draw: Random) -> object:
    kind = draw.random()
    if kind < 0.6:
        return number(draw)
    if kind < 0.85:
        return text(draw)
    return draw.choice((None, True, False, number_text(draw)))
