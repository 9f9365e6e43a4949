"""An account of a file: what it holds, what of it is in the scene, and a note for all the rest."""

from pathlib import Path

from lfcore.scene.notes import NOT_USED, Count, Notebook


class Account:
    """Counts what a file holds and what of it is used.

    A reader calls :meth:`hold` for everything that it meets, :meth:`use` for what it puts into the
    scene, :meth:`lose` for what it leaves out with words of its own, and :meth:`close` at the end,
    which notes all that was held and neither used nor lost.  Things of a kind have one name, a
    plural: ``"vertices"``, ``"materials"``, ``"statements of 'curv'"``.

    Parameters
    ----------
    notebook : Notebook
        Has the file's notes, and the counts once the account is closed.
    file : Path
        The file.
    """

    def __init__(self, notebook: Notebook, file: Path):
        self._notebook, self._file = notebook, file
        self._held: dict[str, list[int]] = {}  # held, used, lost

    def hold(self, what: str, number: int = 1) -> None:
        """Count things that are in the file."""
        self._count(what)[0] += number

    def use(self, what: str, number: int = 1) -> None:
        """Count things that are in the scene, of those that the file holds."""
        self._count(what)[1] += number

    def lose(self, what: str, kind: str, words: str, number: int = 1) -> None:
        """Note why things are not in the scene, or not as they are in the file.

        ``kind`` is one of :data:`lfcore.scene.notes.KINDS`; the same words are noted once, and
        none where another note says it.
        """
        self._count(what)[2] += number
        if words:
            self._notebook.add(kind, self._file, words)

    def close(self) -> None:
        """Note the rest, and hand the counts to the notebook."""
        for what, (held, used, lost) in self._held.items():
            if used + lost < held:
                rest = held - used - lost
                self._notebook.add(NOT_USED, self._file, f"{rest} of {held} {what}")
        self._notebook.counts[self._file] = tuple(
            Count(self._file, what, held, min(used, held))
            for what, (held, used, _) in self._held.items()
            if held
        )

    def _count(self, what: str) -> list[int]:
        return self._held.setdefault(what, [0, 0, 0])
