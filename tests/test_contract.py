"""What every method promises, on every small scene, under every kind of light. A new method joins by its one line."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from soups import SOUPS, Soup
from truth import rational_truth
from umbrae import METHODS, Camera, InputError, Light, Scene, ViewSamples, sample, verify
from umbrae.methods.oracle import Oracle

FAILURES = Path(__file__).parent / "failures"


def lights_of(soup: Soup) -> dict[str, Light]:
    """The six kinds of light, placed by the scene itself."""
    low, high = soup.scene.bounds.astype(np.float64)
    extent = float((high - low).max()) or 1.0
    center = (low + high) / 2
    lights = {
        "point": Light.point(center + extent * np.array([0.7, 1.9, 0.45])),
        "directional": Light.directional((-0.35, -1.0, -0.2)),
        "inside": Light.point(center + extent * np.array([0.01, 0.02, 0.03])),
        "below": Light.point(center - extent * np.array([0.3, 1.5, 0.2])),
    }
    if len(soup.scene.triangles):
        a, b, c = soup.scene.positions[soup.scene.triangles[-1]].astype(np.float64)
        lights["on a vertex"] = Light.point(a)
        # Exactly in the plane wherever these sums are exact, as they are for small whole coordinates.
        lights["in a triangle's plane"] = Light.point(a + 2 * (b - a) + 4 * (c - a))
    return lights


POINTS = [name for name, method in METHODS.items() if "points" in method.accepts]
CASES = [(name, kind) for name, soup in SOUPS.items() for kind in lights_of(soup)]


PICTURES_ONLY = {name for name, method in METHODS.items() if "points" not in method.accepts}


def image_samples(scene: Scene, soup: Soup) -> ViewSamples:
    """A small picture of the soup."""
    return sample(scene, Camera.look_at(soup.eye, soup.target, fov_y=60, width=40, height=28))


def report_failure(name: str, mask: NDArray[np.bool_], truth: NDArray[np.bool_], samples: ViewSamples) -> str:
    """Write mask, truth and difference as pictures; name the first wrong sample."""
    FAILURES.mkdir(exist_ok=True)
    stem = name.replace(" ", "_").replace("'", "")
    for what, values in (("mask", ~mask), ("truth", ~truth), ("difference", mask != truth)):
        picture = np.atleast_2d(values).astype(np.uint8) * 255
        Image.fromarray(picture).resize((picture.shape[1] * 8, picture.shape[0] * 8), 0).save(
            FAILURES / f"{stem}_{what}.png"
        )
    first = tuple(int(i) for i in np.argwhere(mask != truth)[0])
    return (
        f"{np.count_nonzero(mask != truth)} of {mask.size} samples are wrong in {name}; the first is {first}: triangle "
        f"{samples.triangle[first]}, barycentric {samples.barycentric[first].tolist()}, side {samples.side[first]}, "
        f"position {samples.position[first].tolist()}, in shadow {bool(mask[first])}; pictures in {FAILURES}"
    )


@pytest.mark.parametrize("method", POINTS)
@pytest.mark.parametrize("name", SOUPS)
def test_known_answers(method, name):
    for light, samples, answers in SOUPS[name].questions():
        if method in PICTURES_ONLY:
            # Says so, and names a method that answers.
            with pytest.raises(InputError, match=rf"{method}: wanted the samples of a whole picture.*frustum"):
                METHODS[method]().prepare(SOUPS[name].scene).shadow(light, samples)
            continue
        mask = METHODS[method]().prepare(SOUPS[name].scene).shadow(light, samples)
        for index, answer in enumerate(answers):
            assert mask.in_shadow[index] == answer.in_shadow, f"{name}, light {answer.light}: {answer.why}"


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("name", "kind"), CASES)
def test_picture_keeps_the_guarantee(method, name, kind, request):
    if METHODS[method].engine == "OpenGL":
        request.getfixturevalue("opengl")
    soup = SOUPS[name]
    light, samples = lights_of(soup)[kind], image_samples(soup.scene, soup)
    mask = METHODS[method]().prepare(soup.scene).shadow(light, samples)
    assert mask.in_shadow.shape == samples.shape
    assert mask.transmittance.shape == (*samples.shape, 3)
    assert not mask.in_shadow[~samples.covered].any(), "background is lit"
    if method == "oracle":
        # The truth itself is held against plain rationals, on a part of the picture: they are slow.
        chosen = np.flatnonzero(samples.covered.reshape(-1))
        chosen = np.random.default_rng(1).permutation(chosen)[: 2000 // max(1, len(soup.scene.triangles))]
        truth = rational_truth(soup.scene, light, samples.take(chosen))
        np.testing.assert_array_equal(mask.in_shadow.reshape(-1)[chosen], truth)
        return
    verdict = verify(soup.scene, light, samples, mask)
    if not verdict.ok:
        truth = Oracle().prepare(soup.scene).shadow(light, samples).in_shadow
        pytest.fail(report_failure(f"{method} {name} {kind}", mask.in_shadow, truth, samples))


@pytest.mark.parametrize("method", POINTS)
@pytest.mark.parametrize("name", ["cube", "shared_edge", "tilted_grid", "wall_on_ground", "open_fan"])
def test_mask_does_not_depend_on_order_winding_or_splitting(method, name):
    soup = SOUPS[name]
    rng = np.random.default_rng(3)
    points = soup.scene.bounds[0] + rng.random((300, 3)) * (soup.scene.bounds[1] - soup.scene.bounds[0]) * 1.5
    samples = ViewSamples.points(np.round(points * 4) / 4)
    triangles = soup.scene.triangles
    scenes = {
        "permuted": Scene(soup.scene.positions, rng.permutation(triangles)),
        "flipped": Scene(soup.scene.positions, triangles[:, ::-1]),
        "rotated": Scene(soup.scene.positions, np.roll(triangles, 1, axis=1)),
        "split": split_at_midpoints(soup.scene),
    }
    for light in (Light.point((1.5, 7.0, 2.25)), Light.directional((-1, -2, -1))):
        if method in PICTURES_ONLY:
            for kind, scene in scenes.items():
                picture = image_samples(scene, soup)
                mask = METHODS[method]().prepare(scene).shadow(light, picture)
                assert verify(scene, light, picture, mask).ok, f"{name} {kind}"
            continue
        masks = {
            kind: METHODS[method]().prepare(scene).shadow(light, samples).in_shadow
            for kind, scene in {"as it is": soup.scene, **scenes}.items()
        }
        for kind, mask in masks.items():
            np.testing.assert_array_equal(mask, masks["as it is"], err_msg=f"{name} {kind}")


def split_at_midpoints(scene: Scene) -> Scene:
    """Every triangle cut into four; the midpoints must be representable, so this is for small whole coordinates."""
    corners = scene.positions[scene.triangles].astype(np.float64)
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = np.concatenate([np.stack(part, axis=1) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    assert (parts.astype(np.float32) == parts).all(), "a midpoint is not representable"
    return Scene(parts.reshape(-1, 3).astype(np.float32), np.arange(3 * len(parts)).reshape(-1, 3))


@pytest.mark.parametrize("method", POINTS)
def test_moving_scene_and_light_by_a_representable_amount_changes_nothing(method):
    soup = SOUPS["tilted_grid"]
    shift = np.array([64.0, -32.0, 128.0], np.float32)
    moved = Scene(soup.scene.positions + shift, soup.scene.triangles)
    if not ((moved.positions - shift) == soup.scene.positions).all():
        pytest.fail("the soup's coordinates do not survive the move; choose another")
    rng = np.random.default_rng(2)
    triangle = rng.integers(0, len(soup.scene.triangles), 400)
    uv = rng.integers(0, 5, (400, 2)) / 8
    light = np.array([3.0, 6.0, -2.0])
    if method in PICTURES_ONLY:
        aside = Camera.look_at(soup.eye + shift, soup.target + shift, fov_y=60, width=40, height=28)
        samples, source = sample(moved, aside), Light.point(light + shift)
        assert verify(moved, source, samples, METHODS[method]().prepare(moved).shadow(source, samples)).ok
        return
    here = METHODS[method]().prepare(soup.scene)
    there = METHODS[method]().prepare(moved)
    first = here.shadow(Light.point(light), ViewSamples.on_surface(soup.scene, triangle, uv, 1))
    second = there.shadow(Light.point(light + shift), ViewSamples.on_surface(moved, triangle, uv, 1))
    np.testing.assert_array_equal(first.in_shadow, second.in_shadow)


@pytest.mark.parametrize("method", POINTS)
def test_samples_of_another_scene_are_refused(method):
    small, large = SOUPS["one_triangle"].scene, SOUPS["tilted_grid"].scene
    samples = ViewSamples.on_surface(large, [len(large.triangles) - 1], [[0.25, 0.25]], 1)
    with pytest.raises(InputError, match="another scene"):
        METHODS[method]().prepare(small).shadow(Light.point((0, 9, 0)), samples)
