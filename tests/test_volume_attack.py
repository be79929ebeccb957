"""Attacks on the shadow volumes that they withstood: random soups, counts, casters that share one context."""

import dataclasses
import threading

import numpy as np
import pytest

from umbrae import METHODS, Camera, Light, Scene, sample
from umbrae.errors import GraphicsError
from umbrae.gl.context import session
from umbrae.methods.oracle import Exact
from umbrae.methods.volumes.method import VolumeMethod
from umbrae.verify import Truth, verify

pytestmark = pytest.mark.usefixtures("opengl")
VOLUMES = [name for name, method in METHODS.items() if issubclass(method, VolumeMethod)]
SIZES = ((48, 36), (1, 60), (60, 1), (3, 150), (150, 3), (1, 1))


def soup(rng, kind, count=14):
    """Triangles with floor, as `(n, 3, 3)`."""
    if kind == "lattice":
        corners = rng.integers(-2, 3, (count, 3, 3)).astype(float)
    elif kind == "duplicates":
        corners = rng.integers(-2, 3, (4, 3, 3)).astype(float)[rng.integers(0, 4, count)]
        corners = np.stack([triangle[rng.permutation(3)] for triangle in corners])
    elif kind == "slivers":
        a, b = rng.uniform(-2, 2, (2, count, 3))
        c = a + rng.uniform(0, 1, (count, 1)) * (b - a) + rng.normal(0, 1, (count, 3)) * 10.0 ** rng.uniform(-8, -1)
        corners = np.stack([a, b, c], axis=1)
    elif kind == "fan":  # 33 triangles at one edge, more than a patch holds
        third = rng.uniform(-2, 2, (33, 3))
        corners = np.stack([np.tile([0.0, 0, -1], (33, 1)), np.tile([0.0, 0, 1], (33, 1)), third], axis=1)
    else:
        corners = rng.uniform(-2, 2, (count, 3, 3)) * 10.0 ** rng.uniform(-3, 1, (count, 1, 1))
    floor = 10.0 * np.array([[(-1, 0, -1), (1, 0, -1), (1, 0, 1)], [(-1, 0, -1), (1, 0, 1), (-1, 0, 1)]])
    return np.concatenate([corners, floor - np.array([0, 2.25, 0])])


def attack(kind, seed):
    """A scene, a light on a vertex, in a plane, amid the scene or outside, and samples; the eye lies on no triangle."""
    rng = np.random.default_rng(seed)
    corners = soup(rng, kind)
    scene = Scene(corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3))
    a, b, c = corners[rng.integers(len(corners))]
    places = (a, a + rng.normal() * (b - a) + rng.normal() * (c - a), rng.uniform(-2, 2, 3), rng.normal(0, 5, 3))
    axis = np.eye(3)[rng.integers(3)] * rng.choice([-1, 1])
    light = Light.directional(axis) if seed % 5 == 4 else Light.point(places[seed % 5])
    width, height = SIZES[seed % len(SIZES)]
    fov = float(rng.choice([1, 20, 90, 170]))
    camera = Camera.look_at(rng.normal(0, 3, 3), rng.uniform(-1, 1, 3), fov_y=fov, width=width, height=height)
    return scene, light, sample(scene, camera, 1 + 2 * (seed % 2))


@pytest.mark.parametrize("kind", ["lattice", "duplicates", "slivers", "fan", "mixed scales"])
def test_random_soups_cameras_and_lights(kind):
    for seed in range(6):
        scene, light, samples = attack(kind, seed)
        truth = Truth.find(scene, light, samples)
        for method in VOLUMES:
            for counting in ("auto", "zfail"):
                mask = METHODS[method](counting=counting).prepare(scene).shadow(light, samples)
                assert truth.judge(mask).ok, f"{method} {counting} seed {seed}"


def test_counts_are_the_numbers_of_triangles_that_shadow_the_sample():
    rng = np.random.default_rng(7)
    corners = np.concatenate([rng.uniform(-2, 2, (30, 3, 3)), soup(rng, "mixed scales", 1)])
    scene = Scene(corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3))
    samples = sample(scene, Camera.look_at((3, 2.5, 6), (0, -1, 0), fov_y=70, width=40, height=30))
    chosen = np.flatnonzero(samples.covered.reshape(-1))[::20]
    flat = samples.take(chosen)
    for light in (Light.point((0.3, 6, 0.4)), Light.directional((0.2, -1, 0.1)), Light.point((0.1, 0.2, 0.3))):
        exact = Exact(scene, light)
        true = [sum(exact.shades(flat, i, t) > 0 for t in range(len(corners))) for i in range(flat.size)]
        assert max(true) >= 3
        for method in VOLUMES:
            if method != "robust-gs":  # which leaves out what faces away in solids
                found = METHODS[method]().prepare(scene).count(light, samples).reshape(-1)[chosen]
                np.testing.assert_array_equal(found, true, err_msg=method)


def test_casters_of_many_scenes_and_sizes_share_the_context_from_several_threads():
    cases = [attack(kind, seed) for seed, kind in enumerate(("lattice", "fan", "slivers", "mixed scales"))]
    casters = {(i, name): METHODS[name]().prepare(case[0]) for i, case in enumerate(cases) for name in VOLUMES}
    alone = {key: caster.shadow(*cases[key[0]][1:]).in_shadow for key, caster in casters.items()}
    wrong, keys = [], list(casters)

    def work(seed):
        rng = np.random.default_rng(seed)
        for _ in range(25):
            key = keys[rng.integers(len(keys))]
            fresh = rng.random() < 0.2
            caster = METHODS[key[1]]().prepare(cases[key[0]][0]) if fresh else casters[key]
            if not np.array_equal(caster.shadow(*cases[key[0]][1:]).in_shadow, alone[key]):
                wrong.append(key)

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []


@pytest.mark.parametrize("method", VOLUMES)
def test_scenes_with_nothing_that_casts(method):
    nothing = Scene(np.zeros((0, 3)), np.zeros((0, 3), int))
    lines = Scene([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2), (0, 0, 1)])
    behind = Scene([(0, 0, 5), (1, 0, 5), (0, 1, 5)], [(0, 1, 2)])
    for scene in (nothing, lines, behind):
        for width in (1, 16):
            samples = sample(scene, Camera.look_at((0, 0.2, 2), (0.3, 0.2, 0), width=width, height=width))
            for light in (Light.point((0, 1, 0.3)), Light.directional((0.1, -1, 0))):
                caster = METHODS[method]().prepare(scene)
                assert not caster.shadow(light, samples).in_shadow.any()
                assert not caster.count(light, samples).any()
                caster.net_count(light, samples)
                caster.faces_before(light, samples, outlines=True)


def test_pictures_too_large_for_the_driver_are_refused_and_do_no_harm():
    scene, light, samples = attack("lattice", 0)
    with session().current() as current:
        largest = current.integer("GL_MAX_TEXTURE_SIZE")
    wide = dataclasses.replace(samples.camera, width=largest + 1, height=1)
    caster = METHODS["silhouette-ts"]().prepare(scene)
    if wide.width <= 1 << 16:
        with pytest.raises(GraphicsError, match=f"too large for this OpenGL driver.* up to {largest} a side"):
            caster.shadow(light, sample(scene, wide))
    assert verify(scene, light, samples, caster.shadow(light, samples)).ok


@pytest.mark.parametrize("method", VOLUMES)
@pytest.mark.parametrize("seed", [4, 69, 339])
def test_an_eye_in_the_middle_of_a_triangle(method, seed):
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-2, 2, (12, 3, 3))
    corners[0] *= 4
    scene = Scene(corners.reshape(-1, 3), np.arange(36).reshape(-1, 3))
    first = scene.positions[scene.triangles[0]].astype(float)
    eye, light = rng.dirichlet([1, 1, 1]) @ first, Light.point(rng.uniform(-4, 4, 3))
    target = rng.uniform(-1, 1, 3) if seed % 2 else rng.dirichlet([1, 1, 1]) @ first
    samples = sample(scene, Camera.look_at(eye, target, width=96, height=72, fov_y=60))
    mask = METHODS[method]().prepare(scene).shadow(light, samples)
    assert verify(scene, light, samples, mask).ok


@pytest.mark.parametrize("method", VOLUMES)
def test_a_scene_of_few_float32_steps(method):
    # So far from zero that a far plane just behind it would be rounded onto it.
    corners = np.array([(-0.5, 0.5, -0.5), (0.5, 0.5, -0.5), (0, 0.5, 0.5), (-1, 0, -1), (1, 0, -1), (0, 0, 1)])
    scene = Scene((corners + 1e6).astype(np.float32), [(0, 1, 2), (3, 4, 5)])
    middle = np.full(3, 1e6)
    samples = sample(scene, Camera.look_at(middle + np.array([1, 3, 4]), middle, width=64, height=48))
    for light in (Light.directional((0.25, -1, 0.125)), Light.point(middle + np.array([0, 8, 1]))):
        mask = METHODS[method]().prepare(scene).shadow(light, samples)
        assert verify(scene, light, samples, mask).ok


@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize("position", [(3, 10, 2, 0), (3e5, 1e6, 2e5, 1), (3e6, 1e7, 2e6, 1)])
def test_an_inverted_mask_is_wrong_however_far_the_light_and_how_often_the_triangles(times, position):
    plate, floor = [(-1, 1, -1), (1, 1, -1), (0, 1, 1)], [(-4, 0, -4), (4, 0, -4), (4, 0, 4), (-4, 0, 4)]
    scene = Scene(plate + floor, [(0, 1, 2), (3, 4, 5), (3, 5, 6)] * times)
    light = Light(np.array(position, np.float32))
    samples = sample(scene, Camera.look_at((0, 3, 8), (0, 0, 0), width=80, height=60))
    mask = METHODS["silhouette-cpu"]().prepare(scene).shadow(light, samples)
    assert verify(scene, light, samples, mask).ok
    verdict = verify(scene, light, samples, dataclasses.replace(mask, in_shadow=~mask.in_shadow & samples.covered))
    assert verdict.outside_band > 0.99 * verdict.checked
