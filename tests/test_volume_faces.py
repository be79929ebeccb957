"""Faces of shadow volumes: which edges are swept, and distances that were worked out by hand or in rationals."""

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from test_edges import CUBE, CUBE_FACES
from truth import lattice_soup, random_soup
from umbrae.geometry.edges import edges, weld
from umbrae.geometry.volume_faces import face_distance, facing_of_all, multiplicity, volume_faces
from umbrae.light import Light
from umbrae.methods.oracle import Exact
from umbrae.scene import Scene


def light_at(*position):
    return np.array(position, np.float32)


def sweep(positions, triangles, light):
    """Multiplicity of each edge, by its two positions."""
    positions, triangles = np.array(positions, np.float32), np.array(triangles, np.int32).reshape(-1, 3)
    vertex = weld(positions)
    topology = edges(vertex[triangles])
    found = multiplicity(topology, facing_of_all(positions, triangles, light))
    place = {int(v): tuple(positions[i].tolist()) for i, v in enumerate(vertex)}
    return {tuple(place[int(v)] for v in ends): int(m) for ends, m in zip(topology.vertices, found, strict=True)}


def distances(corners, light, points, own=None):
    """Of `points` to the volumes of triangles given by their corners."""
    positions = np.array(corners, np.float32).reshape(-1, 3)
    triangles = np.arange(len(positions), dtype=np.int32).reshape(-1, 3)
    own = None if own is None else np.array(own, np.int32)
    return face_distance(positions, triangles, light, np.array(points, np.float64), own)


def check(found, expected):
    """A bound from below, and no worse than rounding."""
    expected = np.array(expected)
    assert (found <= expected).all()
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-11)


# --- distances ---------------------------------------------------------------------------------------------------


def test_a_triangle_under_the_zenith():
    # The volume is the prism x >= 0, z >= 0, x + z <= 2, y <= 1.
    corners = [(0, 1, 0), (2, 1, 0), (0, 1, 2)]
    answers = {
        (0.5, 3, 0.5): 2,  # above the cap
        (0.5, 1, 0.5): 0,  # on it
        (0.5, 0.875, 0.5): 0.125,  # right under it
        (0.5, -100, 0.25): 0.25,  # deep in the shadow, next to the face z = 0
        (-3, 0, 1): 3,  # beside it
        (-3, 5, 1): 5,  # beside and above: 3, 4, 5 from the edge x = 0
        (2, -7, 2): math.sqrt(2),  # beyond the slanted face
        (5, -9, -4): 5,  # 3, 4, 5 from the ray under (2, 1, 0)
        (5, 13, -4): 13,  # 3, 4, 12, 13 from that vertex
        (0, -1e6, 1): 0,  # on a side face, far away
    }
    check(distances(corners, light_at(0, 1, 0, 0), list(answers)), list(answers.values()))
    # Neither winding nor the length of the direction matters.
    check(distances(corners[::-1], light_at(0, 1e-30, 0, 0), list(answers)), list(answers.values()))


def test_a_triangle_under_a_lamp():
    # From the lamp in (0, 2, 0) the planes of the sides are y - z = 2 and, twice, 2 |x| = 2 - y + z.
    corners = [(-1, 1, -1), (1, 1, -1), (0, 1, 1)]
    answers = {
        (0, 5, 0): 4,  # above the lamp
        (0, 1.5, 0): 0.5,  # between lamp and triangle
        (0, 0.75, 0): 0.25,  # in the shadow, next to the cap
        (0, -8, 0): 10 / math.sqrt(6),  # in the shadow, next to two sides
        (0, -8, -9): 1 / math.sqrt(2),  # in the shadow, next to the third
        (0, 0, -10): 8 / math.sqrt(2),  # beyond that one
        (0, 1, -3): math.sqrt(2),  # beyond it, near its edge
        (0, 2, -2): math.sqrt(2),  # nearest to the edge itself
        (0, -98, 100): 0,  # on the ray through the third vertex
    }
    check(distances(corners, light_at(0, 2, 0, 1), list(answers)), list(answers.values()))


def test_the_own_cap_is_left_out_and_nothing_else():
    corners = [(0, 1, 0), (2, 1, 0), (0, 1, 2), (0, 4, 0), (2, 4, 0), (0, 4, 2)]
    on_both = [(0.5, 1, 0.25), (0.5, 4, 0.25)]
    zenith = light_at(0, 1, 0, 0)
    check(distances(corners, zenith, on_both), [0, 0])
    check(distances(corners, zenith, on_both, [-1, -1]), [0, 0])
    check(distances(corners, zenith, on_both, [0, 1]), [0.25, 0.25])
    check(distances(corners, zenith, on_both, [1, 0]), [0, 0])


def test_no_face_is_infinitely_far():
    zenith, point = light_at(0, 1, 0, 0), [(0.25, 0.25, 0.25)]
    nothing = {
        "no triangle": [],
        "edge-on": [(0, 0, 0), (1, 0, 0), (0, 1, 0)],
        "collinear": [(0, 0, 0), (1, 0, 1), (3, 0, 3)],
        "collapsed": [(0, 0, 0), (1, 0, 0), (1, 0, 0)],
        "a point": [(0, 0, 0)] * 3,
    }
    for what, corners in nothing.items():
        assert distances(corners, zenith, point).tolist() == [np.inf], what
    corners = [(0, 0, 0), (1, 0, 0), (0, 0, 1)]
    for light in ((0, 0, 0, 1), (0.5, 0, 0, 1), (0.25, 0, 0.25, 1), (7, 0, 0, 1), (1, 0, 0, 0)):
        assert distances(corners, light_at(*light), point).tolist() == [np.inf], "light in the plane"
    assert distances(corners, zenith, np.zeros((0, 3))).shape == (0,)


def test_degenerate_triangles_change_nothing_beside_a_sound_one():
    sound = [(0, 1, 0), (2, 1, 0), (0, 1, 2)]
    beside = [(0, 1, 0), (2, 1, 0), (4, 1, 0), (0, 1, 0), (0, 1, 2), (0, 9, 1), (2, 1, 0), (2, 1, 0), (0, 1, 2)]
    points = np.random.default_rng(4).uniform(-3, 3, (200, 3))
    zenith = light_at(0, 1, 0, 0)
    np.testing.assert_array_equal(distances(sound + beside, zenith, points), distances(sound, zenith, points))


def test_the_inside_of_a_tessellated_square_casts_no_side_face():
    # The diagonal passes right over the points; only the cap is near.
    square = [(-4, 1, -4), (4, 1, -4), (4, 1, 4), (-4, 1, -4), (4, 1, 4), (-4, 1, 4)]
    check(distances(square, light_at(0, 1, 0, 0), [(0, -2, 0), (1, 0.5, 1), (0, -90, 3)]), [3, 0.5, 1])
    # As two sheets, one a little lower, each has a diagonal of its own.
    square[3:] = [(x, y - 0.5, z) for x, y, z in square[3:]]
    check(distances(square, light_at(0, 1, 0, 0), [(0, -2, 0)]), [0])


def test_a_lamp_a_hair_off_an_edge_sweeps_it_to_the_other_side():
    # The lamp is 1e-30 from the edge, less than float64 sees next to coordinates of 1. Triangle and two side faces lie
    # in the plane x = z; the edge's own face is a half-plane across it, away from the lamp.
    corners, lamp = [(-1, -1, -1), (1, 1, 1), (0, 5, 0)], light_at(1e-30, 0, 0, 1)
    away, towards = (-20, 10, 10), (20, -10, -10)
    check(distances(corners, lamp, [away, towards]), [0, 10 * math.sqrt(6)])
    # On the other side it is the other way round; from here the nearest face then is the one of the edge to (0, 5, 0).
    check(distances(corners, light_at(-1e-30, 0, 0, 1), [away, towards]), [30 / math.sqrt(2), 0])


# --- multiplicity ------------------------------------------------------------------------------------------------


def test_cube_from_a_corner_is_swept_along_its_six_outer_edges():
    # Two triangles that face alike run along their edge in opposite directions: 1 - 1. Unlike: 1 + 1.
    for light in (light_at(9, 8, 7, 1), light_at(9, 8, 7, 0)):
        found = sweep(CUBE, CUBE_FACES, light)
        swept = {ends for ends, m in found.items() if m}
        assert {abs(m) for m in found.values()} == {0, 2}
        expected = [
            (a, b)
            for a, b in itertools.combinations(map(tuple, CUBE.tolist()), 2)
            if sum(abs(p - q) for p, q in zip(a, b, strict=True)) == 1 and {a, b}.isdisjoint({(0, 0, 0), (1, 1, 1)})
        ]
        assert swept == set(expected) and len(expected) == 6


def test_cube_under_the_zenith_has_walls_that_count_for_nothing():
    # The walls are edge-on: the edges of lid and floor count once each, the walls' own not at all.
    found = sweep(CUBE, CUBE_FACES, light_at(0, 1, 0, 0))
    for ends, m in found.items():
        (a, b), level = ends, ends[0][1] == ends[1][1]
        outline = level and sum(abs(p - q) for p, q in zip(a, b, strict=True)) == 1
        assert abs(m) == (1 if outline else 0)
    assert sum(map(abs, found.values())) == 8


def test_a_light_inside_a_closed_cube_sweeps_nothing():
    assert not any(sweep(CUBE, CUBE_FACES, light_at(0.5, 0.25, 0.25, 1)).values())
    # With the cube opened by one triangle, its three edges are the only ones.
    assert sorted(map(abs, sweep(CUBE, CUBE_FACES[1:], light_at(0.5, 0.25, 0.25, 1)).values())) == [0] * 15 + [1] * 3


@pytest.mark.parametrize(("right", "left"), [(1, 0), (1, 1), (2, 1), (3, 0), (3, 3), (1, 4)])
def test_a_fan_on_one_edge_counts_right_against_left(right, left):
    wings = [(1, -k, 0) for k in range(right)] + [(-1, -k, 0) for k in range(left)]
    corners = [((0, 0, 0), (0, 0, 1), wing)[:: 1 if k % 2 else -1] for k, wing in enumerate(wings)]
    found = sweep(np.reshape(corners, (-1, 3)), np.arange(3 * len(corners)), light_at(0, 1, 0, 0))
    assert abs(found[(0, 0, 0), (0, 0, 1)]) == abs(right - left)


def test_more_wings_than_eight_bits_hold():
    wings = [(1, -k, 0) for k in range(300)]
    corners = [((0, 0, 0), (0, 0, 1), wing) for wing in wings]
    found = sweep(np.reshape(corners, (-1, 3)), np.arange(900), light_at(0, 1, 0, 0))
    assert abs(found[(0, 0, 0), (0, 0, 1)]) == 300


def test_winding_and_order_change_neither_multiplicity_nor_distance():
    rng = np.random.default_rng(8)
    for _ in range(5):
        scene, light = lattice_soup(rng, 40), light_at(*rng.integers(-4, 5, 3) + 0.5, rng.integers(0, 2))
        points = rng.uniform(-4, 4, (50, 3))
        triangles = rng.permutation(scene.triangles)
        flipped = rng.random(len(triangles)) < 0.5
        triangles[flipped] = triangles[flipped][:, ::-1]
        assert sweep(scene.positions, triangles, light) == sweep(scene.positions, scene.triangles, light)
        np.testing.assert_allclose(
            face_distance(scene.positions, triangles, light, points),
            face_distance(scene.positions, scene.triangles, light, points),
            atol=1e-12,
        )


def test_facing_is_exact():
    rng = np.random.default_rng(2)
    for scene in (lattice_soup(rng, 200), random_soup(rng, 100), Scene(np.nextafter(CUBE, 2), CUBE_FACES)):
        for light in (*rng.integers(-3, 4, (4, 4)), (1, 1, 1, 1), (0, 0, 1, 0)):
            light = light_at(*light[:3], light[3] % 2)
            light[0] += not light[:3].any()
            exact = Exact(scene, Light(light))
            expected = [exact.facing(t) for t in range(len(scene.triangles))]
            assert facing_of_all(scene.positions, scene.triangles, light).tolist() == expected


# --- against the definition --------------------------------------------------------------------------------------


def sampled_faces(scene, light, reach, steps):
    """Points on all faces, as dense as `steps`; side faces down to `reach` below their edge."""
    exact = Exact(scene, Light(light))
    share = np.linspace(0, 1, steps)
    cloud = [np.zeros((0, 3))]
    crossed: dict[tuple[tuple[float, ...], tuple[float, ...]], int] = {}
    for t, corners in enumerate(scene.positions[scene.triangles].astype(np.float64)):
        facing = exact.facing(t)
        if facing:
            u, v = (values.reshape(-1, 1) for values in np.meshgrid(share, share))
            cloud.append((1 - u) * corners[0] + u * ((1 - v) * corners[1] + v * corners[2]))
            for a, b in ((0, 1), (1, 2), (2, 0)):
                ends = tuple(corners[a]), tuple(corners[b])
                up = ends[0] < ends[1]
                key = ends if up else ends[::-1]
                crossed[key] = crossed.get(key, 0) + (facing if up else -facing)
    for (a, b), count in crossed.items():
        if count:
            start = np.array(a) + share[:, None] * (np.array(b) - np.array(a))
            away = light[3] * start - light[:3]
            away /= np.linalg.norm(away, axis=1, keepdims=True)
            down = reach * np.linspace(0, 1, 8 * steps)
            cloud.append((start[:, None] + down[:, None] * away[:, None]).reshape(-1, 3))
    return np.concatenate(cloud)


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.integers(1, 5), st.booleans(), st.booleans())
def test_against_a_cloud_of_points_on_the_faces(seed, count, lattice, point_light):
    rng = np.random.default_rng(seed)
    scene = lattice_soup(rng, count) if lattice else random_soup(rng, count, 2.0)
    light = light_at(*rng.integers(-6, 7, 3) + 0.5, point_light)
    points = rng.uniform(-4, 4, (10, 3))
    cloud = sampled_faces(scene, light, 16.0, 40)
    found = face_distance(scene.positions, scene.triangles, light, points)
    nearest = np.linalg.norm(points[:, None] - cloud, axis=2).min(axis=1, initial=np.inf)
    assert (found <= nearest + 1e-12).all()
    # The cloud's meshes are at most about 8.5 / 39 wide across an edge, wider where rays spread: times 4, 16 below it.
    for bound, there in zip(found, nearest, strict=True):
        assert there == np.inf or there <= math.hypot(bound, 0.5)


def rational_distance_squared(scene, light, point):
    """Square of the distance to the nearest face in rationals; None without any."""
    exact = Exact(scene, Light(light))
    source, w = [Fraction(float(x)) for x in light[:3]], Fraction(float(light[3]))
    p = [Fraction(float(x)) for x in point]
    best: list[Fraction] = []
    crossed: dict[tuple[tuple[Fraction, ...], tuple[Fraction, ...]], int] = {}
    for t in range(len(scene.triangles)):
        facing, (a, b, c) = exact.facing(t), exact.corners(t)
        if not facing:
            continue
        best.append(region_squared(p, a, b, minus(c, a), minus(c, b), 1))
        for ends in ((a, b), (b, c), (c, a)):
            key = min(ends, ends[::-1])
            crossed[key] = crossed.get(key, 0) + (facing if key == ends else -facing)
    for (a, b), count in crossed.items():
        if count:
            away = [[w * x - y for x, y in zip(end, source, strict=True)] for end in (a, b)]
            best.append(region_squared(p, a, b, *away, None))
    return min(best, default=None)


def minus(a, b):
    return [x - y for x, y in zip(a, b, strict=True)]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def stretch_squared(p, start, along, reach):
    """To the points start + t along, t from 0 to `reach` (None: infinity)."""
    p = minus(p, start)
    t = max(Fraction(0), dot(p, along) / dot(along, along))
    t = t if reach is None else min(t, Fraction(reach))
    rest = minus(p, [t * x for x in along])
    return dot(rest, rest)


def region_squared(p, a, b, left, right, reach):
    """To the convex region between the edge AB and two sides that start in A and B."""
    edge = minus(b, a)
    normal = cross(edge, left)
    inner = [cross(normal, edge), cross(left, normal), cross(normal, right)]
    if all(dot(n, minus(p, base)) >= 0 for n, base in zip(inner, (a, a, b), strict=True)):
        return dot(normal, minus(p, a)) ** 2 / dot(normal, normal)
    return min(stretch_squared(p, a, edge, 1), stretch_squared(p, a, left, reach), stretch_squared(p, b, right, reach))


SIZES = st.sampled_from([0.0, 1e-45, 1.5e-38, 1e-20, 1e-7, 0.1, 1.0, 1.0000001, 3.0, 7.7e9, 1e18])
COORDINATE = st.builds(lambda size, sign: float(np.float32(size)) * sign, SIZES, st.sampled_from([-1, 1]))
CORNER = st.tuples(COORDINATE, COORDINATE, COORDINATE)


@given(st.lists(CORNER, min_size=3, max_size=6), CORNER, st.booleans(), CORNER)
def test_against_rationals_from_1e_minus_45_to_1e18(corners, source, point_light, point):
    """Slivers, lights almost in line with an edge, and steps of one part in 2**23 between huge and tiny ones."""
    if not point_light and not any(source):
        source = (0.0, 1.0, 0.0)
    count = len(corners) - 2
    strip = np.array([(k, k + 1, k + 2) for k in range(count)])
    scene, light = Scene(np.array(corners, np.float32), strip), light_at(*source, point_light)
    found = float(face_distance(scene.positions, scene.triangles, light, np.array([point]))[0])
    expected = rational_distance_squared(scene, light, point)
    if expected is None:
        assert found == np.inf
        return
    assert found >= 0 and Fraction(found) ** 2 <= expected
    largest = max(abs(x) for row in (*corners, point) for x in row)
    assert Fraction(found + 2.0**-42 * largest) ** 2 >= expected


def test_faces_are_caps_first_then_sides():
    faces = volume_faces(CUBE, CUBE_FACES, light_at(9, 8, 7, 1))
    assert faces.cap.tolist() == [*range(12), *[-2] * 6]
    assert np.isinf(faces.shape[12:, 4:]).all() and (faces.shape[:12, 4] == 1).all()
