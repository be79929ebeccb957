"""What every method promises, on every small scene, under every kind of light. A new method joins by its one line."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from soups import SOUPS, TRANSPARENT, Soup
from truth import rational_transmittance
from umbrae import METHODS, Camera, Guarantee, InputError, Light, Scene, ShadowMask, ViewSamples, sample
from umbrae.methods.method import Method
from umbrae.methods.oracle import Oracle
from umbrae.verify import Truth

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


APPROXIMATE = {"shadow-map": {"size": 64}}
"""Methods that promise nothing of any scene, with options that make them quick: they only have to give a mask."""


def quick(method: str) -> Method:
    """A method as these tests ask it."""
    return METHODS[method](**APPROXIMATE.get(method, {}))


POINTS = [name for name, method in METHODS.items() if "points" in method.accepts and name not in APPROXIMATE]


def takes(method: str, name: str) -> bool:
    """Whether a method takes a soup: those whose casters let light through not all do."""
    return name not in TRANSPARENT or "transparency" in METHODS[method].accepts


CASES = [
    (method, name, kind)
    for method in METHODS
    for name, soup in SOUPS.items()
    if takes(method, name)
    for kind in lights_of(soup)
]


def image_samples(scene: Scene, soup: Soup) -> ViewSamples:
    """A small picture of the soup."""
    return sample(scene, Camera.look_at(soup.eye, soup.target, fov_y=60, width=40, height=28))


@cache
def truth_of_picture(name: str, kind: str) -> Truth:
    """What the oracle says of the picture; asked once for all methods."""
    soup = SOUPS[name]
    return Truth.find(soup.scene, lights_of(soup)[kind], image_samples(soup.scene, soup))


@cache
def truth_of_points(name: str, kind: str) -> Truth:
    """The same of points in and around the soup."""
    soup = SOUPS[name]
    return Truth.find(soup.scene, lights_of(soup)[kind], scattered_samples(soup.scene))


def report_failure(name: str, mask: ShadowMask, truth: ShadowMask, samples: ViewSamples, wrong: int) -> str:
    """Write mask, truth and difference as pictures; name the first wrong sample."""
    FAILURES.mkdir(exist_ok=True)
    stem = name.replace(" ", "_").replace("'", "")
    found, right = mask.transmittance, truth.transmittance
    for what, values in (("mask", found), ("truth", right), ("difference", np.abs(found - right) > mask.tolerance)):
        picture = np.round(values * 255.0).astype(np.uint8)
        Image.fromarray(picture).resize((picture.shape[1] * 8, picture.shape[0] * 8), 0).save(
            FAILURES / f"{stem}_{what}.png"
        )
    first = tuple(int(i) for i in np.unravel_index(wrong, samples.shape))
    return (
        f"samples are wrong in {name}; the first is {first}: triangle {samples.triangle[first]}, barycentric "
        f"{samples.barycentric[first].tolist()}, side {samples.side[first]}, position "
        f"{samples.position[first].tolist()}, in shadow {bool(mask.in_shadow[first])}, light {found[first].tolist()}, "
        f"not {right[first].tolist()}; pictures in {FAILURES}"
    )


@pytest.mark.parametrize(("method", "name"), [(m, name) for m in POINTS for name in SOUPS if takes(m, name)])
def test_known_answers(method, name):
    for light, samples, answers in SOUPS[name].questions():
        mask = METHODS[method]().prepare(SOUPS[name].scene).shadow(light, samples)
        for index, answer in enumerate(answers):
            about = f"{name}, light {answer.light}: {answer.why}"
            assert mask.in_shadow[index] == answer.in_shadow, about
            # Answers are no float32 numbers.
            close = mask.tolerance + 2.0**-24
            np.testing.assert_allclose(mask.transmittance[index], answer.transmittance, 0, close, err_msg=about)


@pytest.mark.parametrize("method", [name for name, method in METHODS.items() if "transparency" not in method.accepts])
@pytest.mark.parametrize("name", sorted(TRANSPARENT))
def test_scenes_that_let_light_through_are_refused(method, name):
    with pytest.raises(InputError, match="let light through"):
        METHODS[method]().prepare(SOUPS[name].scene)


@pytest.mark.parametrize(("method", "name", "kind"), CASES)
def test_picture_keeps_the_guarantee(method, name, kind, request):
    if METHODS[method].engine == "OpenGL":
        request.getfixturevalue("opengl")
    soup, light = SOUPS[name], lights_of(SOUPS[name])[kind]
    samples = image_samples(soup.scene, soup) if method == "oracle" else truth_of_picture(name, kind).samples
    mask = quick(method).prepare(soup.scene).shadow(light, samples)
    assert mask.in_shadow.shape == samples.shape
    assert mask.transmittance.shape == (*samples.shape, 3)
    assert not mask.in_shadow[~samples.covered].any(), "background is lit"
    if method in APPROXIMATE:
        assert mask.guarantee is Guarantee.NONE
        return
    if method == "oracle":
        # The truth itself is held against plain rationals, on a part of the picture: they are slow.
        chosen = np.flatnonzero(samples.covered.reshape(-1))
        chosen = np.random.default_rng(1).permutation(chosen)[: 1000 // max(1, len(soup.scene.triangles))]
        truth = rational_transmittance(soup.scene, light, samples.take(chosen))
        np.testing.assert_array_equal(mask.in_shadow.reshape(-1)[chosen], (truth == 0).all(axis=1))
        np.testing.assert_allclose(mask.transmittance.reshape(-1, 3)[chosen], truth, 0, 2.0**-24)
        return
    verdict = truth_of_picture(name, kind).judge(mask)
    assert verdict.checked == samples.covered.sum()
    if not verdict.ok:
        truth = Oracle().prepare(soup.scene).shadow(light, samples)
        pytest.fail(report_failure(f"{method} {name} {kind}", mask, truth, samples, int(verdict.wrong[0])))


def scattered_samples(scene: Scene) -> ViewSamples:
    """A list of free points in and around the soup, some of them on its vertices, and of places on its triangles."""
    rng, (low, high) = np.random.default_rng(4), scene.bounds.astype(np.float64)
    around = low + rng.uniform(-0.5, 1.5, (60, 3)) * (high - low)
    free = ViewSamples.points(np.concatenate([around, scene.positions[rng.integers(0, len(scene.positions), 20)]]))
    own, uv = rng.integers(0, len(scene.triangles), 80), rng.choice([0.0, 0.25, 0.5], (80, 2))
    on = ViewSamples.on_surface(scene, own, uv, rng.choice([-1, 0, 1], 80))
    order = rng.permutation(160)
    names = ("triangle", "barycentric", "side", "position", "covered")
    return ViewSamples(*(np.concatenate([getattr(free, name), getattr(on, name)])[order] for name in names))


@pytest.mark.parametrize(
    ("method", "name"),
    [
        (m, name)
        for m in POINTS
        for name, soup in SOUPS.items()
        if m != "oracle" and takes(m, name) and len(soup.scene.triangles)
    ],
)
def test_points_keep_the_guarantee(method, name):
    caster = METHODS[method]().prepare(SOUPS[name].scene)
    for kind in lights_of(SOUPS[name]):
        truth = truth_of_points(name, kind)
        verdict = truth.judge(caster.shadow(truth.light, truth.samples))
        assert verdict.ok, f"{kind}: the first wrong sample is {verdict.wrong[0]}"


STEADY = ["cube", "shared_edge", "tilted_grid", "wall_on_ground", "open_fan", *sorted(TRANSPARENT)]


@pytest.mark.parametrize(("method", "name"), [(m, name) for m in POINTS for name in STEADY if takes(m, name)])
def test_mask_does_not_depend_on_order_winding_or_splitting(method, name):
    soup = SOUPS[name]
    rng = np.random.default_rng(3)
    points = soup.scene.bounds[0] + rng.random((300, 3)) * (soup.scene.bounds[1] - soup.scene.bounds[0]) * 1.5
    samples = ViewSamples.points(np.round(points * 4) / 4)
    triangles, order = soup.scene.triangles, rng.permutation(len(soup.scene.triangles))
    scenes = {
        "permuted": with_triangles(soup.scene, triangles[order], soup.scene.material_id[order]),
        "flipped": with_triangles(soup.scene, triangles[:, ::-1]),
        "rotated": with_triangles(soup.scene, np.roll(triangles, 1, axis=1)),
        "split": split_at_midpoints(soup.scene),
    }
    for light in (Light.point((1.5, 7.0, 2.25)), Light.directional((-1, -2, -1))):
        masks = {
            kind: METHODS[method]().prepare(scene).shadow(light, samples)
            for kind, scene in {"as it is": soup.scene, **scenes}.items()
        }
        first = masks["as it is"]
        for kind, mask in masks.items():
            np.testing.assert_array_equal(mask.in_shadow, first.in_shadow, err_msg=f"{name} {kind}")
            # Products in another order differ by the rounding of float32.
            close = 2 * mask.tolerance + 2.0**-23
            np.testing.assert_allclose(mask.transmittance, first.transmittance, 0, close, err_msg=f"{name} {kind}")


def with_triangles(scene: Scene, triangles: NDArray[np.int32], material_id: NDArray[np.int32] | None = None) -> Scene:
    """The same vertices and materials, with other triangles."""
    if material_id is None:
        material_id = scene.material_id
    return Scene(scene.positions, triangles, scene.materials, material_id, uv=scene.uv, colors=scene.colors)


def split_at_midpoints(scene: Scene) -> Scene:
    """Every triangle cut into four; the midpoints must be representable, so this is for small whole coordinates."""

    def quarters(values: NDArray[np.float32]) -> NDArray[np.float32]:
        corners = values[scene.triangles].astype(np.float64)
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        cut = [np.stack(part, axis=1) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        parts = np.concatenate(cut).reshape(-1, values.shape[1])
        assert (parts.astype(np.float32) == parts).all(), "a midpoint is not representable"
        return parts.astype(np.float32)

    positions = quarters(scene.positions)
    uv, colors = (None if values is None else quarters(values) for values in (scene.uv, scene.colors))
    triangles = np.arange(len(positions)).reshape(-1, 3)
    return Scene(positions, triangles, scene.materials, np.tile(scene.material_id, 4), uv=uv, colors=colors)


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
