"""Lights with a size in scenes that let light through: each light sample by itself, against the oracle."""

import numpy as np
import pytest
from numpy.typing import NDArray

from test_area import LAMP, SUN
from test_frustum_transmission import MATERIALS, both, dressed, pane, stack
from truth import lattice_soup, random_soup
from umbrae import Camera, Guarantee, Light, Material, Scene, ShadowMask, ViewSamples, sample, shadow
from umbrae.methods import area_frustum
from umbrae.methods.area_samples import light_samples
from umbrae.methods.frustum_cpu import Frustum
from umbrae.methods.oracle import Oracle
from umbrae.models import sphere, spheres


def oracle_shares(
    scene: Scene, light: Light, samples: ViewSamples, count: int, index: NDArray[np.intp] | None = None
) -> NDArray[np.float64]:
    """`(k, 3)`: the mean over a sample's own light samples of what the oracle lets arrive."""
    chosen = np.arange(samples.size) if index is None else index
    caster, lights = Oracle().prepare(scene), light_samples(light, samples, count, chosen)
    shares = np.empty((len(chosen), count, 3))
    for place, at in enumerate(chosen.tolist()):
        one = samples.take(np.array([at]))
        for number in range(count):
            shares[place, number] = caster.shadow(Light(lights[place, number]), one).transmittance[0]
    return shares.mean(axis=1)


def check(mask: ShadowMask, truth: NDArray[np.float64], index: NDArray[np.intp] | None = None) -> float:
    """Compare an exact mask with the truth; returns the share of numbers that are neither 0 nor 1."""
    found = mask.transmittance.reshape(-1, 3)
    dark = mask.in_shadow.reshape(-1)
    if index is not None:
        found, dark = found[index], dark[index]
    assert mask.guarantee is Guarantee.EXACT and mask.tolerance == 1e-5
    np.testing.assert_allclose(found, truth, rtol=0, atol=mask.tolerance)
    np.testing.assert_array_equal(dark, (truth == 0).all(axis=1))
    return float(((truth > 0) & (truth < 1)).mean())


LIGHTS = [
    LAMP,
    SUN,
    Light.point((0.1, 0.2, 0.05), radius=0.5),
    Light.point((0.1, 0.2, 0.05), radius=50),
    Light.point((0.3, 2.5, 0.2), radius=1e-9),
    Light.directional((1, -1, 1), angular_diameter=60),
]


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("kinds", [[0, 1, 2, 3, 4, 5, 7, 9], [1, 2, 6], [5, 0]], ids=str)
@pytest.mark.parametrize("soup", [lattice_soup, random_soup])
def test_every_share_is_the_mean_of_what_the_oracle_lets_through(soup, kinds, light):
    rng = np.random.default_rng(len(kinds))
    scene = dressed(soup(rng, 40), rng, kinds, colors=soup is lattice_soup and 5 not in kinds)
    samples = both(scene, rng, 40)
    truth, mask = oracle_shares(scene, light, samples, 6), shadow(scene, light, samples, Frustum(light_samples=6))
    if kinds == [5, 0]:  # clear and solid: nothing is dimmed
        assert mask.tolerance == 0 and mask.guarantee is Guarantee.EXACT
        np.testing.assert_array_equal(mask.transmittance, truth.astype(np.float32))
    else:
        assert check(mask, truth) > 0.05


@pytest.mark.parametrize(
    "light", [Light.point((-2, 7, 1.5), radius=1), Light.directional((-1, -2, -0.7), angular_diameter=8)]
)
def test_whole_picture_of_spheres(light):
    scene = spheres(grid=(3, 3), triangles=3000)
    rng = np.random.default_rng(7)
    scene = Scene(
        scene.positions, scene.triangles, MATERIALS, rng.choice([0, 1, 2, 4, 9], len(scene.triangles)),
        uv=rng.uniform(0, 1, (len(scene.positions), 2)),
    )  # fmt: skip
    samples = sample(scene, Camera.frame(scene, width=160, height=90))
    mask = shadow(scene, light, samples, Frustum(light_samples=64))
    chosen = np.sort(rng.permutation(np.flatnonzero(samples.covered.reshape(-1)))[:60])
    assert check(mask, oracle_shares(scene, light, samples, 64, chosen), chosen) > 0.05
    assert (mask.transmittance[~samples.covered] == 1).all() and not mask.in_shadow[~samples.covered].any()


@pytest.mark.parametrize("cells", [1, 4])
@pytest.mark.parametrize("method", [Frustum(), Frustum(transparency="stochastic")])
def test_shared_edges_count_once(cells, method):
    # So small a light that all light samples are its middle: vertices and edges of the pane lie on the rays.
    x, z = (part.reshape(-1) for part in np.meshgrid(np.linspace(0.25, 3.75, 29), np.linspace(0.25, 3.75, 29)))
    on_pane = np.stack([x, np.ones_like(x), z], axis=1)
    samples = ViewSamples.points(on_pane - (np.array([2, 3, 2]) - on_pane) / 2)
    mask = shadow(pane(0.5, cells), Light.point((2, 3, 2), radius=1e-12), samples, method)
    np.testing.assert_allclose(mask.transmittance, 0.5, rtol=0, atol=1e-7)


def test_a_red_pane_before_a_blue_one_has_red_and_blue_edges():
    red, blue = (Material((*rgb, 1.0), transmission=1.0) for rgb in ((1, 0, 0), (0, 0, 1)))
    # Half-planes x < 0 and x < 1, the blue one below: its edge casts the narrower penumbra, farther out.
    corners = [(0, 3, -99), (0, 3, 99), (-198, 3, 0), (1, 2, -99), (1, 2, 99), (-197, 2, 0)]
    scene = Scene(np.array(corners, np.float32), np.array([(0, 1, 2), (3, 4, 5)]), [red, blue], [0, 1])
    samples = ViewSamples.points([[x, 0, 0] for x in (-1, 0, 1, 1.5, 3)])
    mask = shadow(scene, Light.point((0, 6, 0), radius=0.5), samples, Frustum(light_samples=64))
    assert mask.transmittance[0].tolist() == [0, 0, 0] and mask.in_shadow.tolist() == [True, False, False, False, False]
    r, g, b = mask.transmittance[1]  # all light passes blue, half of it red as well
    assert r == g == 0 and b == pytest.approx(0.5, abs=0.05)
    assert mask.transmittance[2].tolist() == [0, 0, 1] and mask.transmittance[4].tolist() == [1, 1, 1]
    r, g, b = mask.transmittance[3]
    assert r == g == pytest.approx(0.5, abs=0.05) and b == 1


@pytest.mark.parametrize(("alpha", "count"), [(0.5, 20), (0.01, 300), (0.5, 400), (1e-9, 300)])
def test_many_casters_of_one_sample(alpha, count):
    mask = shadow(stack([Material((1, 1, 1, alpha), "BLEND")] * count), SUN, ViewSamples.points([[0, 0, 0]]))
    assert mask.transmittance[0] == pytest.approx((1 - alpha) ** count, abs=1e-7)
    assert not mask.in_shadow[0] and (mask.transmittance > 0).all(), "however little it is, light arrives"


# ---- by chance ----


@pytest.mark.parametrize("light", [LAMP, SUN])
def test_by_chance_the_mean_over_seeds_is_that_of_the_light_samples(light):
    rng = np.random.default_rng(3)
    scene = dressed(random_soup(rng, 60), rng, [0, 1, 2, 3, 4, 5, 7, 9])
    samples, count, seeds = both(scene, rng, 60), 7, 400
    truth = oracle_shares(scene, light, samples, count)
    total = np.zeros((samples.size, 3))
    for seed in range(seeds):
        mask = shadow(scene, light, samples, Frustum(light_samples=count, transparency="stochastic", seed=seed))
        assert mask.guarantee is Guarantee.NONE and mask.tolerance == 0
        # A bit for each light sample and channel.
        np.testing.assert_array_equal(np.round(mask.transmittance * count), np.float32(count) * mask.transmittance)
        total += mask.transmittance
    # Of n independent bits with the probabilities p_i the mean has at most the variance p (1 - p) / n of a binomial
    # variable with their mean p; stratified ones never go together, which lowers it further.
    error = np.sqrt(truth * (1 - truth) / (count * seeds))
    assert (error > 0.005).mean() > 0.1
    assert (np.abs(total / seeds - truth) <= 4.5 * error + 1e-6).all()
    off = (total / seeds - truth).sum(axis=0)
    assert (np.abs(off) <= 4 * np.sqrt((error**2).sum(axis=0))).all()


@pytest.mark.parametrize("alpha", [0.3, 0.5, 0.9])
def test_chances_of_a_triangle_are_stratified_over_the_light_samples(alpha):
    scene = Scene(
        np.array([[-99, 1, -99], [-99, 1, 99], [198, 1, 0]]), [(0, 1, 2)], [Material((1, 1, 1, alpha), "BLEND")]
    )
    samples = ViewSamples.points(np.random.default_rng(1).uniform(-1, 0.5, (2000, 3)))
    hit = 32 * (1 - shadow(scene, LAMP, samples, Frustum(transparency="stochastic")).transmittance)
    np.testing.assert_array_equal(hit, hit[:, :1] * np.ones(3))  # grey stays grey
    assert set(np.unique(hit)) == {np.floor(32 * alpha), np.ceil(32 * alpha)}
    assert abs(hit[:, 0].mean() - 32 * alpha) < 4 * 0.5 / np.sqrt(2000)
    # Two triangles are independent of each other.
    twice = Scene(scene.positions, [(0, 1, 2), (0, 1, 2)], scene.materials)
    lit = shadow(twice, LAMP, samples, Frustum(transparency="stochastic")).transmittance[:, 0].astype(float)
    assert abs(lit.mean() - (1 - alpha) ** 2) < 4 * np.sqrt(0.25 / lit.size / 32)
    assert lit.std() > 0.01


@pytest.mark.parametrize("transparency", ["exact", "stochastic"])
def test_neither_threads_nor_blocks_change_a_bit_but_seeds_do(transparency, monkeypatch):
    rng = np.random.default_rng(2)
    scene = dressed(random_soup(rng, 400), rng, [0, 1, 2, 3, 4, 5, 5, 5])
    samples = sample(scene, Camera.look_at((0, 0, 4), (0, 0, 0), width=96, height=64), 2)
    one = shadow(scene, LAMP, samples, Frustum(transparency=transparency)).partial
    for threads in ("1", "5"):
        monkeypatch.setenv("UMBRAE_THREADS", threads)
        np.testing.assert_array_equal(shadow(scene, LAMP, samples, Frustum(transparency=transparency)).partial, one)
    other = shadow(scene, LAMP, samples, Frustum(transparency=transparency, seed=1)).partial
    assert (other == one).all() == (transparency == "exact")
    monkeypatch.setattr(area_frustum, "BLOCK", 1 << 11)
    # Another tree multiplies in another order.
    again = shadow(scene, LAMP, samples, Frustum(transparency=transparency)).partial
    np.testing.assert_allclose(again, one, rtol=0, atol=1e-7 if transparency == "exact" else 0)


def test_culling_leaves_alone_what_lets_light_through():
    balls = [sphere((3 * k, 0, 0), 1.0, 16, 10) for k in range(2)]
    scene = Scene(
        np.concatenate([ball.positions for ball in balls]),
        np.concatenate([balls[0].triangles, balls[1].triangles + len(balls[0].positions)]),
        [MATERIALS[0], MATERIALS[1]],
        np.repeat([0, 1], len(balls[0].triangles)),
    )
    samples = ViewSamples.points(np.random.default_rng(1).uniform((-2, -3, -2), (8, 2, 2), (3000, 3)))
    plain, culled = (shadow(scene, SUN, samples, Frustum(front_face_culling=on)) for on in (False, True))
    np.testing.assert_allclose(plain.transmittance, culled.transmittance, rtol=0, atol=1e-7)
    assert (np.abs(plain.transmittance - 0.25) < 1e-6).any()  # in through one side and out through the other
