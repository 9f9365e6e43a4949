"""Every kind of file appears whole or not at all when the disk fills."""

import resource
from contextlib import contextmanager

import pytest

from lfcore.errors import LfcoreError
from robustness.disks import writers


@contextmanager
def files_of_at_most(size):
    """Bytes beyond are refused as on a full disk: a write is cut short, and the next one fails."""
    before, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, most))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (before, most))


def test_a_disk_that_fills_is_said_and_leaves_nothing(tmp_path):
    for writer in writers(tmp_path):
        folder = tmp_path / writer.name
        folder.mkdir()
        whole, cut = folder / f"whole.{writer.file}", folder / f"cut.{writer.file}"
        writer.write(whole)
        size = whole.stat().st_size
        for limit in (size - 1, size - 1 - size // 50, size // 2, 1):
            with files_of_at_most(limit), pytest.raises(LfcoreError) as error:
                writer.write(cut)
            assert str(error.value).startswith(f"{cut}: cannot be written: File too large")
            assert list(folder.iterdir()) == [whole]
