"""Boxes over objects, and objects cut into compact ones."""

import numpy as np
import pytest

from umbrae.geometry.object_tree import compact_objects, object_boxes, object_tree, refit


def soup(rng: np.random.Generator, objects: int, each: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Objects of `each` triangles, apart from each other, in a random order."""
    centre = rng.uniform(-50, 50, (objects, 1, 1, 3))
    corners = (centre + rng.uniform(-1, 1, (objects, each, 3, 3))).reshape(-1, 3).astype(np.float32)
    triangles = np.arange(len(corners)).reshape(-1, 3).astype(np.int32)
    ids = np.repeat(np.arange(objects), each).astype(np.int32)
    order = rng.permutation(len(triangles))
    return corners, triangles[order], ids[order]


@pytest.mark.parametrize("objects", [1, 2, 3, 7, 8, 100])
def test_every_box_holds_what_is_below(objects):
    positions, triangles, ids = soup(np.random.default_rng(objects), objects, 5)
    lower, upper = object_boxes(positions, triangles, ids, objects)
    tree = object_tree(lower, upper)
    assert sorted(tree.order[tree.order >= 0]) == list(range(objects))
    for k, number in enumerate(tree.order):
        if number < 0:
            continue
        own = positions[triangles[ids == number]].reshape(-1, 3)
        np.testing.assert_array_equal(own.min(axis=0), tree.lower[tree.first_leaf + k])
        np.testing.assert_array_equal(own.max(axis=0), tree.upper[tree.first_leaf + k])
    for node in range(tree.first_leaf):
        for child in (2 * node + 1, 2 * node + 2):
            if (tree.lower[child] <= tree.upper[child]).all():
                assert (tree.lower[node] <= tree.lower[child]).all()
                assert (tree.upper[node] >= tree.upper[child]).all()
    np.testing.assert_array_equal(tree.lower[0], positions.min(axis=0))


def test_objects_without_triangles_have_empty_boxes():
    positions, triangles, ids = soup(np.random.default_rng(1), 3, 4)
    ids[ids == 1] = 2
    lower, upper = object_boxes(positions, triangles, ids, 3)
    tree = object_tree(lower, upper)
    assert not (lower[1] <= upper[1]).any()
    assert np.isfinite(tree.lower[0]).all()


def test_a_refitted_tree_has_the_new_boxes():
    positions, triangles, ids = soup(np.random.default_rng(2), 20, 3)
    tree = object_tree(*object_boxes(positions, triangles, ids, 20))
    moved = positions + np.float32(3) * np.sin(positions)
    boxes = object_boxes(moved, triangles, ids, 20)
    refit(tree, *boxes)
    np.testing.assert_array_equal(tree.upper[0], moved.max(axis=0))
    k = int(np.flatnonzero(tree.order == 7)[0])
    np.testing.assert_array_equal(tree.lower[tree.first_leaf + k], boxes[0][7])


def test_compact_objects_keep_objects_apart():
    positions, triangles, ids = soup(np.random.default_rng(3), 6, 50)
    compact = compact_objects(positions, triangles, ids, 16)
    for number in range(compact.max() + 1):
        assert len(np.unique(ids[compact == number])) == 1
        assert 1 <= (compact == number).sum() <= 16
    assert compact.max() + 1 == 6 * 4
    np.testing.assert_array_equal(np.unique(compact_objects(positions, triangles, ids, 50)), np.arange(6))
    assert len(compact_objects(positions, triangles[:0], ids[:0], 4)) == 0


def test_compact_objects_are_compact():
    rng = np.random.default_rng(4)
    corners = (rng.uniform(-50, 50, (4000, 1, 3)) + rng.uniform(-1, 1, (4000, 3, 3))).reshape(-1, 3).astype(np.float32)
    triangles = np.arange(12000).reshape(-1, 3).astype(np.int32)
    whole = np.zeros(4000, np.int32)
    compact = compact_objects(corners, triangles, whole, 64)
    lower, upper = object_boxes(corners, triangles, compact, compact.max() + 1)
    # In a random order each of the 63 boxes would fill the whole.
    assert np.prod(upper - lower, axis=1).sum() < 4 * 104.0**3
