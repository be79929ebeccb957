"""Generated scenes: the right number of triangles, closed solids, and everything the pavilion promises."""

from collections import Counter

import numpy as np
import pytest
from numpy.typing import NDArray

from soups import SOUPS
from umbrae.errors import InputError
from umbrae.material import Material
from umbrae.models import pavilion, pavilion_camera, pavilion_light, sphere, spheres, spheres_light, town
from umbrae.models.builder import Builder
from umbrae.scene import Scene


def corners(scene: Scene) -> NDArray[np.float64]:
    return scene.positions.astype(np.float64)[scene.triangles]


def facet_normals(scene: Scene) -> NDArray[np.float64]:
    a, b, c = np.moveaxis(corners(scene), 1, 0)
    return np.cross(b - a, c - a)


def welded(scene: Scene) -> NDArray[np.int64]:
    """Triangles by position: vertices at the same place have the same number."""
    _, place = np.unique(scene.positions, axis=0, return_inverse=True)
    return place.reshape(-1)[scene.triangles]


def directed_edges(triangles: NDArray[np.int64]) -> Counter[tuple[int, int]]:
    edges = np.concatenate([triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    return Counter(map(tuple, edges.tolist()))


def assert_closed(triangles: NDArray[np.int64]) -> None:
    edges = directed_edges(triangles)
    assert set(edges.values()) == {1}
    assert all((b, a) in edges for a, b in edges)


def volume(triangle_corners: NDArray[np.float64]) -> float:
    a, b, c = np.moveaxis(triangle_corners, 1, 0)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


@pytest.mark.parametrize(("segments", "rings"), [(3, 2), (4, 3), (7, 5), (32, 16)])
def test_sphere_is_closed_round_and_wound_outward(segments: int, rings: int) -> None:
    center = np.array([1.0, -2.0, 0.5])
    scene = sphere(center, 2.0, segments, rings)
    assert len(scene.triangles) == 2 * segments * (rings - 1)
    assert len(scene.positions) == segments * (rings - 1) + 2
    assert_closed(welded(scene))
    outward = corners(scene).mean(axis=1) - center
    normals = facet_normals(scene)
    assert (np.einsum("ij,ij->i", normals, outward) > 0).all()
    assert np.linalg.norm(scene.positions - center, axis=1) == pytest.approx(2.0, abs=1e-6)
    assert scene.normals is not None
    assert scene.normals == pytest.approx((scene.positions - center) / 2.0, abs=1e-6)


def test_sphere_approaches_a_true_sphere() -> None:
    assert volume(corners(sphere(radius=1.0, segments=128, rings=64))) == pytest.approx(4 / 3 * np.pi, rel=2e-3)


@pytest.mark.parametrize(
    ("grid", "wanted", "made"), [((10, 10), 96_002, 96_002), ((1, 1), 32_402, 32_402), ((3, 2), 50, 50)]
)
def test_spheres_meet_reachable_counts(grid: tuple[int, int], wanted: int, made: int) -> None:
    assert len(spheres(grid, wanted).triangles) == made


@pytest.mark.parametrize("grid", [(1, 1), (10, 10), (31, 7)])
@pytest.mark.parametrize("wanted", [10_000, 123_456])
def test_spheres_come_near_any_count(grid: tuple[int, int], wanted: int) -> None:
    # One more meridian is 2 (rings - 1) triangles a sphere, so half of that is the most that can be missed.
    count = grid[0] * grid[1]
    miss = abs(len(spheres(grid, wanted).triangles) - wanted)
    assert miss <= count * np.sqrt((wanted - 2) / count)


def test_every_sphere_of_the_grid_is_a_closed_object_without_degenerate_triangles() -> None:
    scene = spheres((3, 2), 2_000)
    assert (np.linalg.norm(facet_normals(scene), axis=1) > 0).all()
    assert np.unique(scene.object_id).tolist() == list(range(7))
    assert np.count_nonzero(scene.object_id == 0) == 2
    places = welded(scene)
    for item in range(1, 7):
        own = scene.object_id == item
        assert_closed(places[own])
        assert volume(corners(scene)[own]) > 0
        assert scene.positions[scene.triangles[own]][..., 1].min() > 0
    assert (facet_normals(scene)[:2, 1] > 0).all()
    assert len(np.unique(scene.material_id)) > 3
    assert spheres_light((3, 2)).position[1] > scene.bounds[1, 1]


@pytest.mark.parametrize(("grid", "wanted"), [((0, 3), 1000), ((10, 10), 801), ((2, 2), 10**9)])
def test_impossible_spheres_are_refused(grid: tuple[int, int], wanted: int) -> None:
    with pytest.raises(InputError, match=r"^spheres: wanted"):
        spheres(grid, wanted)


def test_flat_spheres_are_refused() -> None:
    with pytest.raises(InputError, match=r"^sphere: wanted"):
        sphere(segments=2)


@pytest.fixture(scope="module")
def garden() -> Scene:
    return pavilion()


def test_pavilion_is_the_same_every_time(garden: Scene) -> None:
    again = pavilion()
    for name in ("positions", "triangles", "normals", "uv", "material_id", "object_id"):
        assert np.array_equal(getattr(garden, name), getattr(again, name)), name
    for one, two in zip(garden.materials, again.materials, strict=True):
        assert one.base_color == two.base_color
        assert (one.texture is None) == (two.texture is None)
        assert one.texture is None or np.array_equal(one.texture, two.texture)


def test_pavilion_has_every_kind_of_surface(garden: Scene) -> None:
    used = [garden.materials[i] for i in np.unique(garden.material_id)]
    assert len(used) == len(garden.materials), "every material is used"
    assert any(m.alpha_mode == "BLEND" and 0 < m.base_color[3] < 1 for m in used)
    assert any(m.transmission > 0 for m in used)
    assert any(m.texture is not None and m.alpha_mode == "OPAQUE" for m in used)
    cut = [m.texture for m in used if m.alpha_mode == "MASK" and m.texture is not None]
    assert cut
    assert 0.1 < (cut[0][..., 3] > 127).mean() < 0.9
    assert 5_000 < len(garden.triangles) < 40_000


def test_pavilion_has_open_and_non_manifold_edges(garden: Scene) -> None:
    places = welded(garden)
    edges = Counter[tuple[int, int]]()
    for a, b in directed_edges(places).elements():
        edges[min(a, b), max(a, b)] += 1
    assert sum(count == 1 for count in edges.values()) > 1000
    corten = [m.name for m in garden.materials].index("corten")
    fins = Counter[tuple[int, int]]()
    for a, b in directed_edges(places[garden.material_id == corten]).elements():
        fins[min(a, b), max(a, b)] += 1
    assert max(fins.values()) == 3


def test_pavilion_triangles_have_area_and_normals_that_agree_with_them(garden: Scene) -> None:
    normals = facet_normals(garden)
    length = np.linalg.norm(normals, axis=1)
    assert (length > 0).all()
    assert garden.normals is not None
    assert np.linalg.norm(garden.normals, axis=1) == pytest.approx(1.0, abs=1e-5)
    mean = garden.normals[garden.triangles].mean(axis=1)
    assert (np.einsum("ij,ij->i", mean, normals / length[:, None]) > 0.3).all()


def test_pavilion_camera_sees_the_scene_and_the_sun_is_up(garden: Scene) -> None:
    camera = pavilion_camera(160, 90)
    assert (camera.width, camera.height) == (160, 90)
    low, high = garden.bounds
    view = camera.world_to_clip @ np.append((low + high) / 2, 1.0)
    assert view[2] > 0
    assert np.abs(view[:2] / view[2]).max() < 0.5
    assert pavilion_light().is_directional
    assert pavilion_light().position[1] > 0


@pytest.mark.parametrize("axis", [(0, 1, 0), (0, -1, 0), (1, 2, 3), (1, 0, 0)])
def test_builder_solids_are_closed_and_wound_outward(axis: tuple[int, int, int]) -> None:
    build = Builder([Material(name="m")])
    build.lathe([(1.0, 0.0), (0.5, 2.0)], (3, 4, 5), "m", 12, axis)
    build.lathe([(0.0, -1.0), (1.0, 0.0), (0.0, 1.0)], (3, 4, 5), "m", 8, axis, flutes=2)
    build.beam((0, 0, 0), axis, 0.25, 0.5, "m")
    build.box((-1, -2, -3), (1, 2, 3), "m")
    scene = build.scene()
    places, points = welded(scene), corners(scene)
    volumes = []
    for item in range(4):
        own = scene.object_id == item
        assert_closed(places[own])
        volumes.append(volume(points[own]))
    # A frustum of cone with 12 sides, and boxes.
    ring = 12 / 2 * np.sin(2 * np.pi / 12)
    assert volumes[0] == pytest.approx(ring * 2.0 * (1.0 + 0.5 + 0.25) / 3, rel=1e-5)
    assert volumes[1] > 0
    assert volumes[2] == pytest.approx(0.125 * np.linalg.norm(axis), rel=1e-5)
    assert volumes[3] == pytest.approx(48.0)


def test_builder_stairs_rise_away_from_the_viewer() -> None:
    build = Builder([Material(name="m")])
    build.stairs((0, 0, 0), (2, 1, 4), 4, "m")
    scene = build.scene()
    heights = [corners(scene)[scene.object_id == step][..., 1].max() for step in range(4)]
    fronts = [corners(scene)[scene.object_id == step][..., 2].max() for step in range(4)]
    assert heights == [0.25, 0.5, 0.75, 1.0]
    assert fronts == [4.0, 3.0, 2.0, 1.0]


@pytest.mark.parametrize("name", SOUPS)
def test_soups_say_what_they_are_about(name: str) -> None:
    soup = SOUPS[name]
    assert soup.name == name
    assert soup.why
    assert soup.eye != soup.target
    assert soup.answers
    assert all(answer.why for answer in soup.answers)
    assert not soup.scene.origin.any()
    asked = sum(len(answers) for _, _, answers in soup.questions())
    assert asked == len(soup.answers)
    for light, samples, answers in soup.questions():
        assert samples.shape == (len(answers),)
        assert tuple(light.position.tolist()) == answers[0].light


def test_soups_hold_both_verdicts() -> None:
    verdicts = Counter(answer.in_shadow for soup in SOUPS.values() for answer in soup.answers)
    assert verdicts[True] > 200
    assert verdicts[False] > 200


@pytest.mark.parametrize(("grid", "wanted", "tree"), [((1, 1), 14, 0), ((3, 2), 5000, 0), ((4, 5), 40_000, 10_000)])
def test_a_town_has_the_triangles_and_objects_asked_for(grid, wanted, tree):
    scene = town(grid, wanted, tree)
    lots = grid[0] * grid[1]
    assert wanted - 12 * lots < len(scene.triangles) <= wanted
    assert (np.bincount(scene.object_id) > 0).all()
    assert scene.object_id.max() == lots + (tree > 0)
    if tree:
        assert (scene.object_id == lots + 1).sum() == tree
    triangles = welded(scene)
    for number in range(1, lots + 1):
        assert_closed(triangles[scene.object_id == number])
        assert (np.einsum("ij,ij->i", facet_normals(scene), corners(scene)[:, 0])[scene.object_id == number].sum()) > 0
    np.testing.assert_array_equal(scene.positions, town(grid, wanted, tree).positions)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((0, 3), 1000), "at least 1x1 lots"),
        (((10, 10), 100), "1202 to"),
        (((2, 2), 1000, 12), "more than 12 triangles"),
        (((2, 2.5), 1000), "town: grid"),
    ],
)
def test_a_town_that_cannot_be_is_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        town(*arguments)
