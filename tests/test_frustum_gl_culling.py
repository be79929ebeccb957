"""Groups of triangles that `frustum-gl` leaves out: never one that shades a sample."""

import numpy as np
import pytest

from test_culling import both, boxes, crumbs, same, town
from test_frustum_gl import prepared
from truth import lattice_soup, random_samples, random_soup
from umbrae import Camera, Light, Material, Scene, ViewSamples, models, sample, shadow, verify
from umbrae.methods.frustum_gl import caster as frames
from umbrae.methods.frustum_gl import layout
from umbrae.methods.frustum_gl.passes import GROUP

GL = "frustum-gl"
pytestmark = pytest.mark.usefixtures("opengl")
POSITIONS = [(0, 5, 0, 1), (1, 1, 1, 0), (0, 0, -1, 0), (0, 0, 0, 1), (0.1, 0.2, 0.05, 1), (1e12, -3e12, 1e11, 1)]


def groups_of(scene: Scene):
    """Each group of triangles as a scene of its own."""
    for start in range(0, len(scene.triangles), GROUP):
        yield Scene(scene.positions, scene.triangles[start : start + GROUP])


@pytest.mark.parametrize("position", POSITIONS)
@pytest.mark.parametrize("soup", [lattice_soup, random_soup, crumbs])
def test_few_samples_under_any_light_see_what_the_oracle_sees(soup, position):
    rng = np.random.default_rng(3)
    scene, light = soup(rng, 5000), Light(np.array(position))
    every = random_samples(rng, scene, 12)
    for start in range(0, 12, 4):
        samples = every.take(np.arange(start, start + 4))
        culled, all_of_them = both(scene, light, samples, GL)
        same(culled, all_of_them)
        assert verify(scene, light, samples, culled).mismatches == 0


@pytest.mark.parametrize("position", POSITIONS)
def test_a_group_that_shades_a_sample_is_never_left_out(position):
    """Each group by itself, of triangles side by side, against what it truly shades."""
    rng = np.random.default_rng(13)
    light = Light(np.array(position))
    centre = np.repeat(rng.uniform(-1, 1, (24, 1, 3)), GROUP, axis=0)
    corners = centre + rng.uniform(-0.2, 0.2, (24 * GROUP, 1, 3)) + rng.uniform(-0.1, 0.1, (24 * GROUP, 3, 3))
    scene = Scene(corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3))
    found = dropped = 0
    for alone in groups_of(scene):
        # Beyond the middle of a triangle, seen from the light, or not far beside that.
        middle = alone.positions[alone.triangles[:3]].mean(axis=1).astype(float)
        away = light.position[3] * middle - light.position[:3]
        away /= np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-3)
        beside = rng.uniform(-1, 1, (3, 3)) * rng.choice((1e-3, 0.3, 1.0))
        samples = ViewSamples.points(middle + rng.uniform(0, 1, (3, 1)) * away + beside)
        mask = shadow(alone, light, samples, GL)
        truth = shadow(alone, light, samples, "oracle").in_shadow
        np.testing.assert_array_equal(mask.in_shadow, truth)
        assert not (truth.any() and mask.stats["culled"])
        found, dropped = found + bool(truth.any()), dropped + bool(mask.stats["culled"])
    assert found > 5
    assert dropped > 1


@pytest.mark.parametrize("position", [(0, 5, 0, 1), (0.3, 0.2, -0.1, 1), (1, 2, 0.5, 0), (-1, -3, 0, 0)])
def test_samples_on_the_sides_of_what_a_box_may_shade(position):
    """Points on the planes through the light and the edges of a box that is filled with triangles along its edges."""
    rng = np.random.default_rng(17)
    light, source = Light(np.array(position)), np.array(position, float)
    for _ in range(6):
        low = rng.uniform(-1, 1, 3).astype(np.float32)
        box = boxes([low], [low + rng.uniform(0.1, 0.5, 3).astype(np.float32)])
        alone = Scene(box.positions, np.tile(box.triangles, (10, 1)))
        edges = box.positions[box.triangles].astype(float).reshape(-1, 3)
        place = rng.uniform(0, 1, (len(edges), 1))
        on_edge = place * edges + (1 - place) * np.roll(edges, 1, axis=0)
        away = source[3] * on_edge - source[:3]
        samples = ViewSamples.points(np.concatenate([on_edge, on_edge + rng.uniform(0, 3, (len(edges), 1)) * away]))
        for start in range(0, samples.size, 6):
            few = samples.take(np.arange(start, start + 6))
            culled, all_of_them = both(alone, light, few, GL)
            same(culled, all_of_them)
            np.testing.assert_array_equal(culled.in_shadow, shadow(alone, light, few, "oracle").in_shadow)


def test_what_casts_out_of_view_is_counted_and_what_casts_into_it_stays():
    # 64 boxes are 768 triangles, six groups.
    row = np.stack([np.linspace(-0.8, 0.8, 64), np.zeros(64), np.zeros(64)], axis=1)
    away, overhead = np.add(row, (50, 5, 0)), np.add(row, (0, 5, 0))
    scene = boxes(np.concatenate([away, overhead]), np.concatenate([away, overhead]) + 0.02)
    one = 64 * 12
    assert one % GROUP == 0
    points = np.stack([np.linspace(-1, 1, 640), np.zeros(640), np.full(640, 0.01)], axis=1)
    floor = ViewSamples.points(points)
    mask = shadow(scene, Light.directional((0, -1, 0)), floor, GL)
    assert mask.stats["culled"] == one
    assert 0.3 < mask.in_shadow.mean() < 0.9
    # From below everything stands behind the samples.
    assert shadow(scene, Light.directional((0, 1, 0)), floor, GL).stats["culled"] == 2 * one
    # A slanted sun throws the shadow of the other row onto them.
    aslant = Light.directional((-50, -5, 0))
    culled, all_of_them = both(scene, aslant, floor, GL)
    same(culled, all_of_them)
    assert culled.stats["culled"] == one
    assert culled.in_shadow.any()
    # Next to each other both cast, each onto its own samples.
    both_floors = ViewSamples.points(np.concatenate([points, np.add(points, (50, 0, 0))]))
    assert shadow(scene, Light.directional((0, -1, 0)), both_floors, GL).stats["culled"] == 0


def test_an_eye_in_what_boxes_may_shade():
    """Boxes between the light and the eye, behind it, around it, and around the light."""
    ground = boxes([(-40, -1, -40)], [(40, 0, 40)])
    eye = np.array((0.0, 2.0, 0.0))
    seen = 0
    for light in (Light.directional((0.2, -1, 0.1)), Light.point((1, 12, 2)), Light.directional((0, -0.3, 1))):
        toward = light.position[:3] - light.position[3] * eye
        toward = toward / np.linalg.norm(toward)
        for centre, half in ((eye + 5 * toward, 1.0), (eye, 0.5), (eye - 1.5 * toward, 0.3), (eye + 9.5 * toward, 3.0)):
            low = np.repeat([centre - half], 11, axis=0) + np.linspace(0, 0.1, 11)[:, None]
            built = boxes(np.concatenate([low, [(-40, -1, -40)]]), np.concatenate([low + 2 * half, [(40, 0, 40)]]))
            for ahead in ((0, 0, 1), (0.3, 0, -1), (0.1, -1, 0)):
                camera = Camera.look_at(eye, eye + ahead, width=64, height=48)
                # What is seen of the ground alone, under all of the boxes.
                samples = ViewSamples.points(sample(ground, camera).position.reshape(-1, 3)[::7])
                for view in (samples, sample(built, camera)):
                    culled, all_of_them = both(built, light, view, GL)
                    same(culled, all_of_them)
                    seen += culled.in_shadow.any()
    assert seen > 20


def test_a_light_behind_and_a_wall_around_it():
    wall = ViewSamples.points(np.stack([np.full(50, 9.0), *np.random.default_rng(0).uniform(-3, 3, (2, 50))], axis=1))
    places = np.add(np.random.default_rng(2).uniform(-1, 1, (64, 3)), (-8, 0, 0))
    behind = boxes(places, places + 0.2)
    assert shadow(behind, Light.point((0, 0, 0)), wall, GL).stats["culled"] == len(behind.triangles)
    around = boxes([(-5, -5, -5)], [(5, 5, 5)])
    mask = shadow(around, Light.point((0, 0, 0)), wall, GL)
    assert mask.stats["culled"] == 0
    assert mask.in_shadow.all()


def test_one_giant_around_everything_and_the_light_inside_everything():
    scene = town(np.random.default_rng(5), houses=300)
    giant = np.array([(-1e6, -1e6, -1e6), (1e6, -1e6, 2e5), (0, 2e6, 1e6), (3e5, 1e5, -2e6)])
    faces = np.array([(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)]) + len(scene.positions)
    scene = Scene(np.concatenate([scene.positions, giant]), np.concatenate([scene.triangles, faces]))
    samples = sample(scene, Camera.look_at((-60, 12, 0), (0, 0, 0), width=80, height=45))
    for light in (Light.point((0, 3, 0)), Light.point((3e6, 2e6, 0)), Light.directional((1, -1, 0.5))):
        culled, all_of_them = both(scene, light, samples, GL)
        same(culled, all_of_them)
        assert verify(scene, light, samples, culled, count=500).mismatches == 0


@pytest.mark.parametrize("gap", [0.0, 1e-30, 1e-7])
def test_samples_at_the_light_keep_everything(gap):
    rng = np.random.default_rng(6)
    scene, light = random_soup(rng, 2000), Light.point((0.25, 0.5, -0.125))
    samples = ViewSamples.points(np.array([0.25, 0.5, -0.125]) + gap * rng.normal(size=(20, 3)))
    same(*both(scene, light, samples, GL))


def test_nothing_there():
    nothing = Scene(np.zeros((0, 3)), np.zeros((0, 3), int))
    light, samples = Light.point((0, 5, 0)), ViewSamples.points(np.zeros((3, 3)))
    assert shadow(nothing, light, samples, GL).stats["culled"] == 0
    scene = town(np.random.default_rng(0), houses=10)
    sky = sample(scene, Camera.look_at((0, 50, 0), (0, 60, 1), width=8, height=8))
    assert not sky.covered.any()
    culled, all_of_them = both(scene, light, sky, GL)
    same(culled, all_of_them)
    assert culled.stats["culled"] == len(scene.triangles)


def test_casters_that_let_light_through_are_culled_past_what_solid_ones_have_darkened():
    glass = Material(alpha_mode="BLEND", base_color=(1, 0.5, 0.2, 0.5))
    low = [(-5, 2, -5), *[(x, 4, 0) for x in np.linspace(-4, 3, 32)]]
    high = [(5, 3, 5), *[(x + 0.5, 4.1, 1) for x in np.linspace(-4, 3, 32)]]
    built = boxes(low, high)
    kinds = np.repeat([0, 1], [12, 32 * 12])
    floor = ViewSamples.points(np.random.default_rng(0).uniform((-4, 0, -4), (4, 1, 4), (200, 3)))
    roofed = Scene(built.positions, built.triangles, [Material(), glass], material_id=kinds)
    light = Light.directional((0.1, -1, 0.05))
    # Without the roof the panes dim what is below.
    bare = Scene(built.positions, built.triangles[12:], [Material(), glass], material_id=kinds[12:])
    for transparency in ("exact", "stochastic"):
        culled, all_of_them = both(roofed, light, floor, GL, transparency=transparency)
        same(culled, all_of_them)
        assert culled.in_shadow.all()
        assert culled.stats["culled"] == 32 * 12
        mask, every = both(bare, light, floor, GL, transparency=transparency)
        same(mask, every)
        assert mask.stats["culled"] == 0
        assert mask.partial.min() < 1


@pytest.mark.parametrize("transparency", ["exact", "stochastic"])
def test_a_town_with_panes_above_in_bands_and_small_batches(transparency, monkeypatch):
    rng = np.random.default_rng(11)
    solid = town(rng, houses=400)
    half = Material(alpha_mode="BLEND", base_color=(1, 0.5, 0.2, 0.5))
    low = np.concatenate([rng.uniform(-100, 100, (400, 1)), np.full((400, 1), 12), rng.uniform(-100, 100, (400, 1))], 1)
    low = low[np.lexsort((low[:, 2], low[:, 0] // 20))]
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
        culled, all_of_them = both(scene, light, samples, GL, transparency=transparency)
        same(culled, all_of_them)
        assert len(scene.triangles) > culled.stats["culled"] > len(scene.triangles) / 4
        assert 0 < culled.partial.mean() < 1
        with monkeypatch.context() as patch:
            patch.setattr(layout, "BLOCK", 103 * 20)
            banded = prepared(scene, transparency=transparency).shadow(light, samples)
            patch.setattr(frames, "BATCH", 200)
            patch.setattr(frames, "ROOM", 64)
            batched = prepared(scene, transparency=transparency).shadow(light, samples)
        for mask in (banded, batched):
            np.testing.assert_array_equal(mask.in_shadow, all_of_them.in_shadow)
            np.testing.assert_array_equal(mask.partial, all_of_them.partial)


def test_front_face_culling_goes_with_it():
    scene = models.spheres((3, 3), 4000)
    samples = sample(scene, Camera.frame(scene, width=160, height=90))
    culled, all_of_them = both(scene, models.spheres_light((3, 3)), samples, GL, front_face_culling=True)
    same(culled, all_of_them)
    np.testing.assert_array_equal(culled.in_shadow, shadow(scene, models.spheres_light((3, 3)), samples).in_shadow)


def test_boxes_hold_their_groups(opengl):
    rng = np.random.default_rng(10)
    scene = random_soup(rng, 5 * GROUP - 7)
    tiny = Scene(scene.positions * np.float32(1e-39), scene.triangles)  # below 2^-126, where drivers may see zeros
    for one in (scene, tiny):
        made = prepared(one)
        assert made.passes.groups == 5
        with opengl.current():
            found = np.frombuffer(made.passes._bounds.read(), np.float32).reshape(-1, 2, 3)
        for number, alone in enumerate(groups_of(one)):
            corners = one.positions[alone.triangles].reshape(-1, 3)
            np.testing.assert_array_equal(found[number], [corners.min(axis=0), corners.max(axis=0)])
