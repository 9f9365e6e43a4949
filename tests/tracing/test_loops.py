"""Every loop of every kernel ends, after a number of turns that is stated here."""

import re

import pytest
from plain_scenes import SCENES

KERNELS = sorted((SCENES.parent / "lfcore").rglob("*.cl"))

LOOP = re.compile(r"\b(?:for|while)\s*\(")
STEP = r"(?:\+\+{0}\b|--{0}\b|\b{0}\+\+|\b{0} (?:\+|-|/)= |\b{0} &= {0} - 1\b)"
"""Steps of a counter, or of the bits of a mask, whose number the type bounds."""
COMPARED = r"\b{0}\b (<|>|<=|>=) |(^|&& ?|\s){0}\s*($|&&)"
BOUNDS = {
    r"next_leaf\(|next_occluding\(|stack(->|\.)size": "a node or leaf of the tree, each once",
    r"atomic_inc\(next\w*\)": "a piece of work: the counter only grows",
    r"next_span\(": "a ray of a block: a span takes the nearest (test_bounds.py)",
    r"left && row_inside|left = row_bits\(": "a bit of the mask: turns clear the lowest",
    r"count = paths->going": "a hit of each path, of at most MOST_HITS (paths.cl)",
    r"^bits$": "a bit of the mask: each turn clears the highest",
}
"""What a turn of the other loops uses up, by the loop's head."""


def closing(text, at):
    """The place behind the bracket that closes the one at ``at``."""
    depth = 0
    for place in range(at, len(text)):
        depth += (text[place] in "({") - (text[place] in ")}")
        if not depth:
            return place + 1
    raise AssertionError(f"no bracket closes {text[at : at + 60]}")


def loops(text):
    """Head and body of each loop; the body of a `do` is before its `while`."""
    text = re.sub(r"//[^\n]*", "", text)
    for found in LOOP.finditer(text):
        end = closing(text, found.end() - 1)
        rest = text[end:].lstrip()
        body = rest[: closing(rest, 0)] if rest[0] == "{" else rest[: rest.index(";") + 1]
        head = text[found.end() : end - 1]
        if rest[0] == ";":  # of `do`
            body = text[text.rfind("do ", 0, found.start()) : found.start()]
            head = f"{body} {head}" if "next_" in body else head
        yield head, body


def is_counted(head, body):
    """Whether the condition compares a variable that steps, and that nothing else assigns."""
    parts = head.split(";")
    condition, step = parts[1:] if len(parts) == 3 else (head, "")
    for name in set(re.findall(r"[a-z]\w*", condition)):
        compared = re.search(COMPARED.format(name), condition)
        steps = re.search(STEP.format(name), step + condition + body)
        if steps and compared and not re.search(rf"(?<!\w )\b{name} = ", body):
            return True
    return False


def test_every_loop_counts_or_uses_something_up():
    assert len(KERNELS) > 40
    unbounded = [
        f"{path.name}: {head}"
        for path in KERNELS
        for head, body in loops(path.read_text(encoding="utf-8"))
        if not is_counted(head, body) and not any(re.search(known, head) for known in BOUNDS)
    ]
    assert not unbounded


@pytest.mark.parametrize(
    ("loop", "ends"),
    [
        ("for (int k = 0; k < n; ++k) f(k);", True),
        ("for (uint m = x; m; m &= m - 1) f(m);", True),
        ("while (i > 0 && a[i] > v) { --i; }", True),
        ("do ++run; while (run < end && run->x == y);", True),
        ("for (int k = 0; k < n; ++k) { k = 0; }", False),
        ("while (z < until) z = next(z);", False),
        ("do x = mix(x); while (x >= count);", False),
    ],
)
def test_a_loop_that_does_not_count_is_found(loop, ends):
    assert [is_counted(*found) for found in loops(loop)] == [ends]
