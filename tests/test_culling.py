"""Clusters that surely shade nothing are left out: masks stay, to the last bit, and what is left out is counted."""

import dataclasses

import numpy as np
import pytest

from soups import SOUPS
from test_contract import CASES, image_samples, lights_of
from truth import lattice_soup, random_samples, random_soup
from umbrae import Camera, Light, Material, Scene, ViewSamples, sample, shadow, verify
from umbrae.methods import make_method
from umbrae.methods.frustum_cpu import Frustum
from umbrae.methods.lit_clusters import LitClusters
from umbrae.methods.triangle_clusters import cluster_triangles
from umbrae.models import spheres, spheres_light

CULLING = ("frustum", "frustum-gl", "smooth")
"""Methods with the option."""


def both(scene: Scene, light: Light, samples: ViewSamples, method: str = "frustum", **options):
    """Masks with and without culling."""
    return [shadow(scene, light, samples, make_method(method, culling=on, **options)) for on in (True, False)]


def same(one, other) -> None:
    np.testing.assert_array_equal(one.in_shadow, other.in_shadow)
    assert other.stats["culled"] == 0
    if one.partial is not None:
        np.testing.assert_array_equal(one.partial, other.partial)


def boxes(low, high) -> Scene:
    """One axis-parallel box of 12 triangles for each row of `low` and `high (n, 3)`."""
    corners = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    faces = np.array(
        [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
         (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    )  # fmt: skip
    low, high = np.asarray(low, float), np.asarray(high, float)
    positions = np.where(corners == 0, low[:, None], high[:, None])
    return Scene(positions.reshape(-1, 3), (faces + 8 * np.arange(len(low))[:, None, None]).reshape(-1, 3))


def town(rng: np.random.Generator, houses: int = 1500, size: float = 100.0) -> Scene:
    """Houses, street by street, on a floor of two triangles."""
    place, half = rng.uniform(-size, size, (houses, 2)), rng.uniform(0.5, 2.5, (houses, 2))
    place = place[np.lexsort((place[:, 1], place[:, 0] // 8))]
    height = rng.uniform(1, 9, houses)
    low = np.stack([place[:, 0] - half[:, 0], np.zeros(houses), place[:, 1] - half[:, 1]], axis=1)
    high = np.stack([place[:, 0] + half[:, 0], height, place[:, 1] + half[:, 1]], axis=1)
    built = boxes(low, high)
    floor = size * 1.1 * np.array([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)])
    start = len(built.positions)
    two = np.array([(0, 2, 1), (0, 3, 2)]) + start
    return Scene(np.concatenate([built.positions, floor]), np.concatenate([built.triangles, two]))


@pytest.mark.parametrize("method", CULLING)
def test_masks_stay_on_a_flight_through_a_town_with_moving_houses_and_lights(method):
    rng = np.random.default_rng(1)
    scene = town(rng)
    caster, most = make_method(method).prepare(scene), 0
    for frame in range(6):
        moved = scene.positions.copy()
        moved[: 8 * 700] += np.float32(2 * np.sin(frame)) * np.array((1, 0, 0.5), np.float32)
        now = scene.moved(moved)
        eye = np.array((-80 + 30 * frame, 1.7 if frame % 2 else 25.0, 10 * np.cos(frame)))
        camera = Camera.look_at(eye, np.add(eye, (20, -2 - 6 * (frame % 2 == 0), 5)), width=96, height=54)
        samples = sample(now, camera)
        turn = 0.7 * frame
        lights = (
            Light.directional((np.cos(turn), -0.2 - 0.3 * frame, np.sin(turn))),
            Light.point(np.add(eye, (3 * np.cos(turn), 4, 3 * np.sin(turn)))),
            Light.point((150, 90 - 20 * frame, -50)),
        )
        caster.follow(now)
        for light in lights:
            culled, all_of_them = both(now, light, samples, method)
            same(culled, all_of_them)
            # Boxes move with the vertices.
            same(caster.shadow(light, samples), all_of_them)
            most = max(most, culled.stats["culled"])
    assert most > 0.9 * len(scene.triangles)


def crumbs(rng: np.random.Generator, count: int) -> Scene:
    """Triangles a tenth as large as the cube they lie in."""
    corners = rng.uniform(-1, 1, (count, 1, 3)) + rng.uniform(-0.1, 0.1, (count, 3, 3))
    return Scene(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


@pytest.mark.parametrize("soup", [lattice_soup, random_soup, crumbs])
@pytest.mark.parametrize(
    "position", [(0, 5, 0, 1), (1, 1, 1, 0), (0, 0, 1, 0), (0, 0, 0, 1), (0.1, 0.2, 0.05, 1), (1e12, -3e12, 1e11, 1)]
)
def test_few_samples_under_any_light_see_what_the_oracle_sees(soup, position):
    rng = np.random.default_rng(3)
    scene, light = soup(rng, 5000), Light(np.array(position))
    every, most = random_samples(rng, scene, 40), 0
    for start in range(0, 40, 4):
        samples = every.take(np.arange(start, start + 4))
        culled, all_of_them = both(scene, light, samples)
        same(culled, all_of_them)
        most = max(most, culled.stats["culled"])
        assert verify(scene, light, samples, culled).mismatches == 0
    assert most > 100 or soup is not crumbs


def test_what_casts_out_of_view_is_counted_and_what_casts_into_it_stays():
    # 64 boxes are 48 clusters, three groups.
    row = np.stack([np.linspace(-0.8, 0.8, 64), np.zeros(64), np.zeros(64)], axis=1)
    away, overhead = np.add(row, (50, 5, 0)), np.add(row, (0, 5, 0))
    scene = boxes(np.concatenate([away, overhead]), np.concatenate([away, overhead]) + 0.02)
    one = 64 * 12
    points = np.stack([np.linspace(-1, 1, 640), np.zeros(640), np.full(640, 0.01)], axis=1)
    floor = ViewSamples.points(points)
    mask = shadow(scene, Light.directional((0, -1, 0)), floor)
    assert mask.stats["culled"] == one
    assert 0.3 < mask.in_shadow.mean() < 0.9
    # From below everything stands behind the samples.
    assert shadow(scene, Light.directional((0, 1, 0)), floor).stats["culled"] == 2 * one
    # A slanted sun throws the shadow of the other row onto them.
    aslant = Light.directional((-50, -5, 0))
    mask = shadow(scene, aslant, floor)
    assert mask.stats["culled"] == one
    assert mask.in_shadow.any()
    assert shadow(scene, aslant, floor, Frustum(culling=False)).stats["culled"] == 0
    # Next to each other both cast, each onto its own samples.
    both_floors = ViewSamples.points(np.concatenate([points, np.add(points, (50, 0, 0))]))
    assert shadow(scene, Light.directional((0, -1, 0)), both_floors).stats["culled"] == 0


def test_a_light_behind_and_a_wall_around_it():
    # A point light before a wall: what stands behind the light casts nothing to the wall, but what stands around does.
    wall = ViewSamples.points(np.stack([np.full(50, 9.0), *np.random.default_rng(0).uniform(-3, 3, (2, 50))], axis=1))
    rng = np.random.default_rng(2)
    places = np.add(rng.uniform(-1, 1, (64, 3)), (-8, 0, 0))
    behind = boxes(places, places + 0.2)
    assert shadow(behind, Light.point((0, 0, 0)), wall).stats["culled"] == len(behind.triangles)
    around = boxes([(-5, -5, -5)], [(5, 5, 5)])
    mask = shadow(around, Light.point((0, 0, 0)), wall)
    assert mask.stats["culled"] == 0
    assert mask.in_shadow.all()


def test_one_giant_around_everything_and_the_light_inside_everything():
    scene = town(np.random.default_rng(5), houses=300)
    giant = np.array([(-1e6, -1e6, -1e6), (1e6, -1e6, 2e5), (0, 2e6, 1e6), (3e5, 1e5, -2e6)])
    faces = np.array([(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)]) + len(scene.positions)
    scene = Scene(np.concatenate([scene.positions, giant]), np.concatenate([scene.triangles, faces]))
    samples = sample(scene, Camera.look_at((-60, 12, 0), (0, 0, 0), width=80, height=45))
    for light in (Light.point((0, 3, 0)), Light.point((3e6, 2e6, 0)), Light.directional((1, -1, 0.5))):
        culled, all_of_them = both(scene, light, samples)
        same(culled, all_of_them)
        assert verify(scene, light, samples, culled, count=500).mismatches == 0


def test_a_hundred_thousand_tiny_triangles():
    rng = np.random.default_rng(7)
    centre = rng.uniform(-10, 10, (100_000, 1, 3))
    corners = centre + rng.normal(scale=1e-3, size=(100_000, 3, 3))
    scene = Scene(corners.reshape(-1, 3), np.arange(300_000).reshape(-1, 3))
    # Around one place: a third of the points stand right beyond the middle of a triangle, seen from the light.
    light, middle = np.array((0.5, 14.0, 0.25)), corners.mean(axis=1)
    nearest = middle[np.argsort(np.linalg.norm(middle - (4, -3, 2), axis=1))[:100]]
    points = np.concatenate([nearest + 1e-3 * (nearest - light), np.add((4, -3, 2), rng.uniform(-1, 1, (200, 3)))])
    samples, light = ViewSamples.points(points), Light.point(light)
    culled, all_of_them = both(scene, light, samples)
    same(culled, all_of_them)
    assert 90 < culled.in_shadow.sum() < 150
    assert culled.stats["culled"] > 80_000


@pytest.mark.parametrize("gap", [0.0, 1e-30, 1e-7])
def test_samples_at_the_light_keep_everything(gap):
    rng = np.random.default_rng(6)
    scene, light = random_soup(rng, 2000), Light.point((0.25, 0.5, -0.125))
    samples = ViewSamples.points(np.array([0.25, 0.5, -0.125]) + gap * rng.normal(size=(20, 3)))
    culled, all_of_them = both(scene, light, samples)
    same(culled, all_of_them)
    assert culled.stats["culled"] == 0


def test_nothing_there():
    nothing = Scene(np.zeros((0, 3)), np.zeros((0, 3), int))
    light, samples = Light.point((0, 5, 0)), ViewSamples.points(np.zeros((3, 3)))
    assert shadow(nothing, light, samples).stats["culled"] == 0
    scene = town(np.random.default_rng(0), houses=10)
    sky = sample(scene, Camera.look_at((0, 50, 0), (0, 60, 1), width=8, height=8))
    assert not sky.covered.any()
    culled, all_of_them = both(scene, light, sky)
    same(culled, all_of_them)
    assert culled.stats["culled"] == len(scene.triangles)


def test_casters_that_let_light_through_are_culled_past_what_solid_ones_have_darkened():
    rng = np.random.default_rng(11)
    solid = town(rng, houses=400)
    half = Material(alpha_mode="BLEND", base_color=(1, 0.5, 0.2, 0.5))
    low = np.concatenate([rng.uniform(-100, 100, (400, 1)), np.full((400, 1), 12), rng.uniform(-100, 100, (400, 1))], 1)
    panes = boxes(low, np.add(low, (3, 0.1, 3)))
    start, count = len(solid.positions), len(solid.triangles)
    scene = Scene(
        np.concatenate([solid.positions, panes.positions]),
        np.concatenate([solid.triangles, panes.triangles + start]),
        [Material(), half],
        material_id=np.repeat([0, 1], [count, len(panes.triangles)]),
    )
    samples = sample(scene, Camera.look_at((-60, 3, 0), (-20, 0, 5), width=96, height=54))
    for light in (Light.directional((0.3, -1, 0.2)), Light.point((-40, 30, 0))):
        for transparency in ("exact", "stochastic"):
            culled, all_of_them = both(scene, light, samples, transparency=transparency)
            same(culled, all_of_them)
            assert len(scene.triangles) > culled.stats["culled"] > len(scene.triangles) / 2
            assert 0 < culled.partial.mean() < 1


def test_a_pane_above_a_roof_is_culled_once_the_roof_has_darkened_all_below():
    glass = Material(alpha_mode="BLEND", base_color=(1, 1, 1, 0.5))
    built = boxes(
        [(-5, 2, -5), *[(x, 4, 0) for x in range(-4, 4)]], [(5, 3, 5), *[(x + 0.5, 4.1, 1) for x in range(-4, 4)]]
    )
    kinds = np.repeat([0, 1], [12, 8 * 12])
    floor = ViewSamples.points(np.random.default_rng(0).uniform((-4, 0, -4), (4, 1, 4), (200, 3)))
    roofed = Scene(built.positions, built.triangles, [Material(), glass], material_id=kinds)
    light = Light.directional((0.1, -1, 0.05))
    culled, all_of_them = both(roofed, light, floor)
    same(culled, all_of_them)
    assert culled.in_shadow.all() and culled.stats["culled"] == 8 * 12
    # Without the roof the panes dim what is below.
    bare = Scene(built.positions, built.triangles[12:], [Material(), glass], material_id=kinds[12:])
    mask = shadow(bare, light, floor)
    assert mask.stats["culled"] == 0 and not mask.in_shadow.any() and mask.partial.min() < 1


def test_blocks_count_what_none_of_them_needs(monkeypatch):
    scene = town(np.random.default_rng(4), houses=400)
    samples = sample(scene, Camera.look_at((-60, 3, 0), (-20, 0, 5), width=96, height=54))
    light = Light.point((-40, 30, 0))
    whole = shadow(scene, light, samples)
    monkeypatch.setattr("umbrae.methods.frustum_cpu.BLOCK", 96 * 8)
    banded = shadow(scene, light, samples)
    np.testing.assert_array_equal(whole.in_shadow, banded.in_shadow)
    assert 0 < whole.stats["culled"] <= banded.stats["culled"] < len(scene.triangles)


@pytest.mark.parametrize("position", [(0, 5, 0, 1), (0.1, 0.2, 0.05, 1), (3, -2, 1, 1), (1, 1, 1, 0), (-3, -1, 0.2, 0)])
def test_a_cluster_that_shades_a_sample_is_never_left_out(position):
    """Each cluster by itself, against what it truly shades."""
    rng = np.random.default_rng(13)
    scene, light = random_soup(rng, 640), Light(np.array(position))
    samples = ViewSamples.points(rng.uniform(-1.5, 1.5, (60, 3)))
    found = 0
    for start in range(0, 640, 16):
        alone = Scene(scene.positions, scene.triangles[start : start + 16])
        culled = shadow(alone, light, samples)
        truth = shadow(alone, light, samples, "oracle").in_shadow
        np.testing.assert_array_equal(culled.in_shadow, truth)
        assert not (truth.any() and culled.stats["culled"])
        found += bool(truth.any())
    assert found > 5


def test_front_face_culling_goes_with_it():
    scene = spheres(grid=(3, 3), triangles=4000)
    samples, light = sample(scene, Camera.frame(scene, width=160, height=90)), spheres_light((3, 3))
    culled, all_of_them = both(scene, light, samples, front_face_culling=True)
    same(culled, all_of_them)
    np.testing.assert_array_equal(culled.in_shadow, shadow(scene, light, samples).in_shadow)


def test_sides_are_found_for_what_is_seen_and_what_casts_alone(monkeypatch):
    scene = town(np.random.default_rng(9), houses=3000)
    samples = sample(scene, Camera.look_at((-60, 30, 0), (-58, 0, 1), width=96, height=54))
    assert cluster_triangles(scene, None).in_order and len(scene.triangles) > samples.size
    faced = []
    find = LitClusters.find

    def spy(self, wanted, clock):
        find(self, wanted, clock)
        faced.append((self.sides != 0).any(axis=1).mean())

    monkeypatch.setattr(LitClusters, "find", spy)
    shadow(scene, Light.point((-40, 30, 0)), samples)
    assert 0 < faced[0] < faced[-1] < 0.5


def test_boxes_hold_their_clusters_and_rows_of_them():
    rng = np.random.default_rng(10)
    scene = random_soup(rng, 16 * 300 - 5)
    clusters = cluster_triangles(scene, None)
    assert clusters.groups == 19
    levels = clusters.boxes.reshape(-1, 3, 2, 16)
    low, high = clusters.corners.min(axis=(1, 3)), clusters.corners.max(axis=(1, 3))
    np.testing.assert_array_equal(levels[:19, :, 0].swapaxes(1, 2).reshape(-1, 3)[:300], low)
    np.testing.assert_array_equal(levels[:19, :, 1].swapaxes(1, 2).reshape(-1, 3)[:300], high)
    assert (levels[18, :, 0, 12:] == np.inf).all()
    assert (levels[18, :, 1, 12:] == -np.inf).all()
    rows = levels[19:, :, 0].swapaxes(1, 2).reshape(-1, 3)
    np.testing.assert_array_equal(rows[:18], low[:288].reshape(18, 16, 3).min(axis=1))
    np.testing.assert_array_equal(rows[18], low[288:].min(axis=0))
    assert (rows[19:] == np.inf).all()
    np.testing.assert_array_equal(clusters.bounds, scene.bounds)


@pytest.mark.parametrize(("method", "name", "kind"), [case for case in CASES if case[0] in CULLING])
def test_small_scenes_look_the_same_without(method, name, kind):
    soup = SOUPS[name]
    same(*both(soup.scene, lights_of(soup)[kind], image_samples(soup.scene, soup), method))


@pytest.mark.parametrize("method", CULLING)
def test_options_say_so(method):
    assert make_method(method).options()["culling"] is True
    assert dataclasses.replace(make_method(method), culling=False).options()["culling"] is False
