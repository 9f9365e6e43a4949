"""The account of a file: what is neither used nor lost is noted."""

from pathlib import Path

from lfcore.readers.account import Account
from lfcore.scene.notes import LEFT_OUT, NOT_USED, Note, Notebook

FILE = Path("a.xyz")


def test_the_rest_is_noted_and_everything_is_counted():
    notebook = Notebook()
    account = Account(notebook, FILE)
    account.hold("vertices", 8)
    account.hold("lights")
    account.hold("curves", 5)
    account.use("vertices", 8)
    account.lose("lights", LEFT_OUT, "light 'sun'")
    account.use("curves", 2)
    account.close()
    assert notebook.notes() == (
        Note(LEFT_OUT, FILE, 0, "light 'sun'"), Note(NOT_USED, FILE, 0, "3 of 5 curves"),
    )  # fmt: skip
    counts = notebook.counts[FILE]
    assert [(one.what, one.held, one.used) for one in counts] == [
        ("vertices", 8, 8), ("lights", 1, 0), ("curves", 5, 2),
    ]  # fmt: skip
