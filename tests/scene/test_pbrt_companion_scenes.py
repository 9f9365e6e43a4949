"""The assignment's scenes: book, hillside behind trees, sphere."""

import numpy as np
import pytest

from lfcore.scene.procedural import book, ecosys
from lfcore.scene.surface_mesh import count


def test_the_book_leans_back_and_faces_the_cameras():
    cover = next(part for part in book.build(0) if part.surface.name == "cover")
    edges = [cover.triangles[0, k] - cover.triangles[0, 0] for k in (1, 2)]
    normal = np.cross(*edges)
    normal /= np.linalg.norm(normal)
    # The image of +y under the pose of the pbrt scene.
    np.testing.assert_allclose(normal, [0.267, 0.664, 0.698], atol=2e-3)
    top, bottom = cover.triangles[cover.uvs[..., 1] == 1], cover.triangles[cover.uvs[..., 1] == 0]
    assert top[:, 1].min() > bottom[:, 1].max() and top[:, 2].max() < bottom[:, 2].min()
    right, left = cover.triangles[cover.uvs[..., 0] == 1], cover.triangles[cover.uvs[..., 0] == 0]
    assert right[:, 0].mean() > left[:, 0].mean()


def test_the_covers_words_are_on_it():
    """Other words change the page where they stand and nowhere else."""

    def page(**words):
        return next(p for p in book.build(0, **words) if p.surface.name == "cover").surface.texture

    difference = (page() != page(authors="D. Caustic")).any(-1)
    rows = np.flatnonzero(difference.any(1))
    assert difference.sum() > 1000 and rows.min() > 1060 and rows.max() < 1180


@pytest.mark.slow
def test_the_hillside_holds_more_than_a_million_triangles():
    """Counted from the plants' own sizes, without building them all."""
    sparse, denser = (
        count(ecosys.build(5, plants=plants, tree_leaves=100, terrain=10))
        for plants in (0.01, 0.02)
    )
    trees_and_ground = 200 * 200 * 2 + 2 * 9000 * 2
    assert (denser - sparse) * 100 + trees_and_ground > 1_000_000


def test_the_trees_stand_before_the_hill():
    parts = ecosys.build(5, plants=0.0, tree_leaves=400, terrain=40)
    leaves = [part.triangles for part in parts if part.surface.name == "tree leaf"]
    assert len(leaves) == len(ecosys.TREES)
    for (x, distance, height), crown in zip(ecosys.TREES, leaves, strict=True):
        middle = crown.reshape(-1, 3).mean(0)
        assert abs(middle[0] - x) < 0.2 * height and abs(middle[2] + distance) < 0.2 * height
        assert crown[..., 1].max() < ecosys.ground_height(x, -distance) + 1.3 * height
    assert ecosys.ground_height(0, -100) > ecosys.ground_height(0, -20) + 15
