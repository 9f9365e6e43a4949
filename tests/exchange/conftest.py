"""Light field files of noise, with and without a geometry."""

import pytest
from noise_fields import noise, store

from lfcore.exchange.grid import Geometry


@pytest.fixture(scope="session")
def square(tmp_path_factory):
    """3 x 3 views of 16 x 16 pixels, with a geometry."""
    return store(tmp_path_factory.mktemp("square"), noise(3, 3, 16, 16))


@pytest.fixture(scope="session")
def wide(tmp_path_factory):
    """4 columns and 2 rows of 22 x 16 pixels, with a geometry."""
    return store(tmp_path_factory.mktemp("wide"), noise(2, 4, 16, 22))


@pytest.fixture(scope="session")
def unknown(tmp_path_factory):
    """As ``square``, without a geometry."""
    return store(tmp_path_factory.mktemp("unknown"), noise(3, 3, 16, 16), Geometry())
