"""An account of a file: the number of things in it and in the scene, and notes on the others."""

from pathlib import Path

from lfcore.scene.notes import NOT_USED, Count, Notebook


class Account:
    """Counts the things of a file, and those of them that are used.

    A reader calls :meth:`hold` for each thing in the file, :meth:`use` for each that it puts into
    the scene, and :meth:`lose` for each that it notes in words of its own.  :meth:`close` notes all
    others.  Things of a kind have one name, a plural: ``"vertices"``, ``"statements of 'curv'"``.

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

    def hold(self, things: str, number: int = 1) -> None:
        """Count things that are in the file."""
        self._count(things)[0] += number

    def use(self, things: str, number: int = 1) -> None:
        """Count things of the file that are in the scene."""
        self._count(things)[1] += number

    def lose(self, things: str, kind: str, words: str, number: int = 1) -> None:
        """Note why things of the file are missing or changed in the scene.

        ``kind`` is one of :data:`lfcore.scene.notes.KINDS`; equal words are noted once;
        empty words add no note.
        """
        self._count(things)[2] += number
        if words:
            self._notebook.add(kind, self._file, words)

    def close(self) -> None:
        """Note the unused rest, and give the counts to the notebook."""
        for things, (total, used, lost) in self._held.items():
            if used + lost < total:
                rest = total - used - lost
                self._notebook.add(NOT_USED, self._file, f"{rest} of {total} {things}")
        self._notebook.counts[self._file] = tuple(
            Count(self._file, things, total, min(used, total))
            for things, (total, used, _) in self._held.items()
            if total
        )

    def _count(self, things: str) -> list[int]:
        return self._held.setdefault(things, [0, 0, 0])
