"""Edges, windings and silhouettes of soups whose counts are known by hand."""

import itertools
import time

import numpy as np
import pytest

from umbrae.geometry.edges import edges, silhouette_share, weld, zero_area

CUBE = np.array(list(itertools.product((0, 1), repeat=3)), np.float32)
CUBE_FACES = np.array(
    [
        *((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5)),
        *((0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6)),
        *((0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)),
    ],
    np.int32,
)


def soup(positions, triangles):
    """The same triangles with three vertices of their own each, and indices to match."""
    return positions[triangles].reshape(-1, 3), np.arange(3 * len(triangles), dtype=np.int32).reshape(-1, 3)


def test_weld_orders_positions_lexicographically():
    positions = np.array([(1, 0, 0), (0, 2, 0), (0, 1, 5), (1, 0, 0), (0, 1, -5)], np.float32)
    assert weld(positions).tolist() == [3, 2, 1, 3, 0]


def test_weld_is_exact_but_for_the_sign_of_zero():
    near = np.nextafter(np.float32(1), np.float32(2))
    positions = np.array([(0.0, 1, 0), (-0.0, 1, -0.0), (0, near, 0)], np.float32)
    assert weld(positions).tolist() == [0, 0, 1]
    assert np.signbit(positions[1, 0])  # the caller's array is left alone
    assert weld(np.zeros((0, 3), np.float32)).tolist() == []


def test_cube_is_closed_and_balanced_however_it_is_indexed():
    for positions, triangles in ((CUBE, CUBE_FACES), soup(CUBE, CUBE_FACES)):
        found = edges(weld(positions)[triangles])
        assert found.count.tolist() == [2] * 18
        assert found.balance.tolist() == [0] * 18
        assert found.degenerate.size == 0
        assert (found.vertices[:, 0] < found.vertices[:, 1]).all()
        assert (np.lexsort(found.vertices.T[::-1]) == np.arange(18)).all()


def test_adjacency_names_each_triangle_and_its_direction():
    found = edges(np.array([(0, 1, 2), (2, 1, 3)], np.int32))
    assert found.vertices.tolist() == [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]
    assert found.offsets.tolist() == [0, 1, 2, 4, 5, 6]
    assert found.triangle.tolist() == [0, 0, 0, 1, 1, 1]
    assert found.sign.tolist() == [1, -1, 1, -1, 1, -1]


def test_a_flipped_triangle_unbalances_its_three_edges():
    faces = CUBE_FACES.copy()
    faces[5] = faces[5][::-1]
    found = edges(faces)
    assert np.bincount(np.abs(found.balance)).tolist() == [15, 0, 3]


def test_300_triangles_on_one_edge():
    fan = np.array([(0, 1, 2 + index) for index in range(300)], np.int32)
    found = edges(fan)
    assert found.count[0] == 300 and found.balance[0] == 300  # more than an int8 holds
    assert (found.count[1:] == 1).all()


def test_collapsed_triangles_are_left_out_and_named():
    found = edges(np.array([(0, 1, 2), (3, 3, 4), (5, 6, 5), (7, 7, 7), (8, 9, 9)], np.int32))
    assert found.degenerate.tolist() == [1, 2, 3, 4]
    assert len(found.vertices) == 3
    empty = edges(np.zeros((0, 3), np.int32))
    assert empty.count.size == empty.balance.size == 0


def test_against_counting_in_a_dictionary():
    rng = np.random.default_rng(5)
    triangles = rng.integers(0, 12, (200, 3)).astype(np.int32)
    expected: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for index, corners in enumerate(triangles.tolist()):
        if len(set(corners)) == 3:
            for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
                expected.setdefault((min(a, b), max(a, b)), []).append((index, 1 if a < b else -1))
    found = edges(triangles)
    rows = {
        (int(a), int(b)): list(zip(found.triangle[i:j].tolist(), found.sign[i:j].tolist(), strict=True))
        for (a, b), i, j in zip(found.vertices, found.offsets[:-1], found.offsets[1:], strict=True)
    }
    assert rows == expected


def test_zero_area_is_decided_without_rounding():
    tiny = np.float32(2.0**-149)
    near = np.nextafter(np.float32(3), np.float32(4))
    cases = [
        (((0, 0, 0), (1, 1, 1), (3, 3, 3)), True),
        (((0, 0, 0), (1, 1, 1), (3, 3, near)), False),
        (((5, 5, 5), (5, 5, 5), (1, 2, 3)), True),
        (((0, 0, 0), (tiny, 0, 0), (0, tiny, 0)), False),
        (((0, 0, 0), (1e18, 1e18, 0), (-1e18, -1e18, 0)), True),
        # sides that float64 cannot hold: with them rounded, the first would have no area
        (((tiny, 0, 0), (1e18, 1e18, 0), (-1e18, -1e18, 0)), False),
        (((tiny, tiny, 0), (1e18, 1e18, 0), (-1e18, -1e18, 0)), True),
    ]
    positions = np.array([corners for corners, _ in cases], np.float32).reshape(-1, 3)
    triangles = np.arange(len(positions), dtype=np.int32).reshape(-1, 3)
    assert zero_area(positions, triangles).tolist() == [expected for _, expected in cases]


def test_silhouette_of_a_cube_seen_from_one_side_is_its_face():
    found = edges(CUBE_FACES)
    assert (weld(CUBE) == np.arange(8)).all()
    above = np.array([(0.5, 0.4, 9.0, 1.0)])
    assert silhouette_share(CUBE, CUBE_FACES, found, above) == pytest.approx(4 / 18)
    corner = np.array([(9.0, 8.0, 7.0, 1.0)])
    assert silhouette_share(CUBE, CUBE_FACES, found, corner) == pytest.approx(6 / 18)
    sun = np.array([(9.0, 8.0, 7.0, 0.0)])
    assert silhouette_share(CUBE, CUBE_FACES, found, np.concatenate([above, sun])) == pytest.approx(5 / 18)
    inside = np.array([(0.5, 0.4, 0.3, 1.0)])
    assert silhouette_share(CUBE, CUBE_FACES, found, inside) == 0.0


def test_silhouettes_do_not_depend_on_winding():
    rng = np.random.default_rng(3)
    faces = CUBE_FACES.copy()
    flipped = rng.random(len(faces)) < 0.5
    faces[flipped] = faces[flipped][:, ::-1]
    lights = np.concatenate([rng.uniform(-5, 5, (20, 3)), np.ones((20, 1))], axis=1)
    assert silhouette_share(CUBE, faces, edges(faces), lights) == silhouette_share(
        CUBE, CUBE_FACES, edges(CUBE_FACES), lights
    )


def test_an_open_edge_is_a_silhouette_unless_its_triangle_is_edge_on():
    triangle = np.array([(0, 1, 2)], np.int32)
    positions = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], np.float32)
    assert silhouette_share(positions, triangle, edges(triangle), np.array([(0, 0, 1.0, 0)])) == 1.0
    assert silhouette_share(positions, triangle, edges(triangle), np.array([(1.0, 2, 0, 0)])) == 0.0


def test_half_a_million_triangles_take_seconds():
    side = 500
    corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).reshape(-1)
    lower = np.stack([corner, corner + 1, corner + side + 2], axis=1)
    upper = np.stack([corner, corner + side + 2, corner + side + 1], axis=1)
    triangles = np.concatenate([lower, upper]).astype(np.int32)
    x, y = np.meshgrid(np.arange(side + 1), np.arange(side + 1), indexing="ij")
    positions = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3).astype(np.float32)
    start = time.perf_counter()
    found = edges(weld(positions)[triangles])
    assert time.perf_counter() - start < 5.0
    assert (found.count == 1).sum() == 4 * side
    assert (found.count == 2).sum() == 3 * side * side - 2 * side
