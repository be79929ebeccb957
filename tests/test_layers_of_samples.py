"""What lies behind transparent surfaces: peeled layer by layer, or chosen by chance."""

import numpy as np
import pytest
from numpy.typing import NDArray

import umbrae.memory
from umbrae.camera import Camera
from umbrae.errors import CapacityError, InputError, OptionError
from umbrae.geometry.chance import LIGHT, VIEW, chances, key_of
from umbrae.geometry.texture import fetch, pack
from umbrae.material import Material
from umbrae.parallel import kernel
from umbrae.samples import ViewSamples
from umbrae.sampling import layers as layers_module
from umbrae.sampling import sample, sample_layers, sample_stochastic
from umbrae.sampling.seen import BYTES_PER_SAMPLE
from umbrae.scene import Scene
from umbrae.transmission import CLEAR, VARYING, passing, transmission_of

ARRAYS = ("triangle", "barycentric", "side", "position", "covered", "depth")
CAMERA = Camera.look_at((0, 0, 4), (0, 0, 0), fov_y=60.0, width=31, height=31)

WALL = Material((0.8, 0.8, 0.8))
PANE = Material((0.2, 0.4, 0.6, 0.25), "BLEND")
GLASS = Material((0.9, 0.5, 0.1), transmission=0.8)
CLEAR_GLASS = Material((1, 1, 1), transmission=1.0)
NOTHING = Material((1, 1, 1, 0), "BLEND")


def squares(*sheets: tuple[float, Material], size: float = 8.0, colors=None) -> Scene:
    """Squares across the view at given z, each two triangles 2 i and 2 i + 1, with uv (0, 0) at the top left."""
    corner = np.array([(-1, 1), (-1, -1), (1, -1), (1, 1)], float) * size
    positions = np.concatenate([np.column_stack([corner, np.full(4, z)]) for z, _ in sheets])
    triangles = np.concatenate([np.array([(0, 1, 2), (0, 2, 3)]) + 4 * i for i in range(len(sheets))])
    return Scene(
        positions.astype(np.float32),
        triangles,
        [material for _, material in sheets],
        np.repeat(np.arange(len(sheets)), 2),
        uv=np.tile([(0, 0), (0, 1), (1, 1), (1, 0)], (len(sheets), 1)),
        colors=colors,
    )


def sheets_of(layer: ViewSamples) -> NDArray[np.int32]:
    """Which sheet of `squares` each sample sees; -1 for background."""
    return np.where(layer.covered, layer.triangle // 2, -1)


def check_same(one: ViewSamples, other: ViewSamples) -> None:
    for name in ARRAYS:
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name


# Peeling


@pytest.mark.parametrize("per_pixel", [1, 3])
def test_a_solid_scene_has_one_layer_which_is_what_is_seen(per_pixel):
    scene = squares((0.0, WALL), (1.0, Material(alpha_mode="BLEND")), (-1.0, PANE), size=1.0)
    (only,) = sample_layers(scene, CAMERA, samples_per_pixel=per_pixel)
    check_same(only, sample(scene, CAMERA, per_pixel))
    assert (sheets_of(only)[only.covered] == 1).all() and only.covered.any() and not only.covered.all()


def test_two_panes_over_a_floor():
    scene = squares((-2.0, WALL), (1.0, PANE), (0.0, GLASS), (-3.0, PANE))
    layers = sample_layers(scene, CAMERA)
    assert len(layers) == 3
    check_same(layers[0], sample(scene, CAMERA))
    for layer, (sheet, depth) in zip(layers, [(1, 3.0), (2, 4.0), (0, 6.0)], strict=True):
        assert (sheets_of(layer) == sheet).all()
        np.testing.assert_allclose(layer.depth, depth, rtol=1e-6)
        layer.check(scene)
    # What is found behind is what is seen without the sheets before it.
    check_same(layers[2], sample(Scene(scene.positions, scene.triangles[:2]), CAMERA))


def test_no_more_layers_than_wanted():
    scene = squares(*((-float(z), PANE) for z in range(5)))
    assert [len(sample_layers(scene, CAMERA, count)) for count in (1, 2, 4, 5, 8)] == [1, 2, 4, 5, 5]
    check_same(sample_layers(scene, CAMERA, 2)[1], sample_layers(scene, CAMERA, 8)[1])
    check_same(sample_layers(scene, CAMERA, 1)[0], sample(scene, CAMERA))


def test_coincident_surfaces_are_peeled_in_order_of_their_index():
    square = squares((0.0, PANE))
    turned = [square.triangles, square.triangles[:, ::-1], square.triangles[:, [1, 2, 0]]]
    scene = Scene(
        np.concatenate([square.positions, square.positions - (0, 0, 1)]),
        np.concatenate([*turned, square.triangles + 4]),
        [PANE, WALL],
        [0] * 6 + [1] * 2,
    )
    layers = sample_layers(scene, CAMERA)
    assert [np.unique(sheets_of(layer)).tolist() for layer in layers] == [[0], [1], [2], [3]]
    assert len({layer.depth.tobytes() for layer in layers[:3]}) == 1
    assert (layers[0].side == 1).all() and (layers[1].side == -1).all() and (layers[2].side == 1).all()


def test_a_pane_that_crosses_a_wall():
    wall = squares((0.0, WALL), size=8.0)
    # Its left half stands before the wall, its right half behind.
    leaning = np.array([(-8, 8, 2), (-8, -8, 2), (8, -8, -2), (8, 8, -2)], np.float32)
    scene = Scene(
        np.concatenate([wall.positions, leaning]), [*wall.triangles, (4, 5, 6), (4, 6, 7)], [WALL, PANE], [0, 0, 1, 1]
    )
    first, second = sample_layers(scene, CAMERA)
    left = first.position[..., 0] < 0
    assert 0.4 < left.mean() < 0.6
    np.testing.assert_array_equal(sheets_of(first), left)
    np.testing.assert_array_equal(sheets_of(second), np.where(left, 0, -1))


def test_what_is_nearer_than_the_near_plane_is_in_no_layer():
    scene = squares((1.0, PANE), (0.0, PANE), (-1.0, WALL))
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), fov_y=60.0, width=9, height=9, near=3.5)
    assert [np.unique(sheets_of(layer)).tolist() for layer in sample_layers(scene, camera)] == [[1], [2]]


def test_layers_end_sample_by_sample():
    half = np.full((1, 2, 4), 255, np.uint8)
    half[0, 0, 3] = 100
    texture = np.repeat(half, 64, axis=1)  # the left half lets light through, the right one does not
    scene = squares((0.0, Material((1, 1, 1), "BLEND", texture=texture)), (-1.0, WALL), size=3.0)
    first, second = sample_layers(scene, CAMERA)
    assert (sheets_of(first) == 0).all()
    x = first.position[..., 0]
    clear = (np.abs(x) > 0.05) & (np.abs(x) < 2.4)
    assert clear.mean() > 0.9
    np.testing.assert_array_equal(sheets_of(second)[clear], np.where(x < 0, 1, -1)[clear])
    # Full opacity ends layers also where the texture is asked, and so does glass of a colour that nothing passes.
    black = np.array([[(0, 0, 0, 255), (0, 0, 0, 255), (255, 255, 255, 255), (255, 255, 255, 255)]], np.uint8)
    scene = squares((0.0, Material((1, 0, 0), transmission=1.0, texture=black)), (-1.0, WALL), size=3.0)
    _, second = sample_layers(scene, CAMERA)
    at_texel = x / 6 * 4 + 2
    assert (sheets_of(second)[(at_texel > 0.6) & (at_texel < 1.4)] == -1).all()
    assert (sheets_of(second)[(at_texel > 2.6) & (at_texel < 3.4)] == 1).all()


def test_what_is_not_there_is_in_no_layer_but_clear_glass_is():
    scene = squares((2.0, NOTHING), (1.0, CLEAR_GLASS), (0.0, Material((1, 1, 1, 0.3), "MASK")), (-1.0, WALL))
    assert (transmission_of(scene).kind[:6] == CLEAR).all()
    layers = sample_layers(scene, CAMERA)
    assert [np.unique(sheets_of(layer)).tolist() for layer in layers] == [[1], [3]]


def test_vertex_colours_tint_clear_glass():
    tint = np.concatenate([np.full((4, 4), (1, 0.5, 0, 1)), np.ones((4, 4))])
    dark = np.concatenate([np.full((4, 4), (0, 0, 0, 1)), np.ones((4, 4))])
    scene = squares((0.0, CLEAR_GLASS), (-1.0, WALL), colors=tint)
    assert (transmission_of(scene).kind[:2] == VARYING).all()
    assert len(sample_layers(scene, CAMERA)) == 2
    black = squares((0.0, CLEAR_GLASS), (-1.0, WALL), colors=dark)
    assert len(sample_layers(black, CAMERA)) == 1


@kernel
def passing_at(triangles, table, triangle, barycentric, found):
    for i in range(len(triangle)):
        u, v = np.float64(barycentric[i, 0]), np.float64(barycentric[i, 1])
        red, green, blue = passing(triangles, table, triangle[i], 1.0 - u - v, u, v)
        found[i, 0], found[i, 1], found[i, 2] = red, green, blue


@pytest.mark.parametrize("cutoff", [0.1, 0.5, 127 / 255, 1.0])
@pytest.mark.parametrize("colored", [False, True])
def test_holes_are_those_that_shadows_have(cutoff, colored):
    """A masked surface is seen exactly where its shadow's table says that nothing passes."""
    random = np.random.default_rng(7)
    texture = random.choice(np.array([0, 127, 255], np.uint8), (16, 16, 4))
    colors = np.concatenate([random.uniform(0.5, 1, (4, 4)), np.ones((4, 4))]) if colored else None
    scene = squares((0.0, Material((1, 1, 1), "MASK", cutoff, texture=texture)), (-1.0, WALL), size=5.0, colors=colors)
    camera = Camera.look_at((0.3, 0.2, 4), (0, 0, 0), fov_y=50.0, width=200, height=150)
    shown = sheets_of(sample(scene, camera)) == 0
    everywhere = sample(scene.opaque(), camera)
    assert (sheets_of(everywhere) == 0).all()
    found = np.empty((everywhere.size, 3))
    flat = everywhere.take(np.arange(everywhere.size))
    passing_at(scene.triangles, transmission_of(scene), flat.triangle, flat.barycentric, found)
    assert 0.02 < shown.mean() < 0.98 or cutoff == 1.0
    np.testing.assert_array_equal(found, np.repeat(1.0 - shown.reshape(-1, 1), 3, axis=1))
    masked = Scene(scene.positions, scene.triangles[:2], scene.materials, uv=scene.uv, colors=scene.colors)
    (only,) = sample_layers(masked, camera)
    np.testing.assert_array_equal(only.covered, shown)


def test_a_full_mask_has_no_holes_at_its_cutoff():
    """What rounding makes of interpolated alpha does not matter where alpha is the same everywhere."""
    for value in (77, 128, 201, 255):
        texture = np.full((5, 7, 4), value, np.uint8)
        scene = squares((0.0, Material((1, 1, 1), "MASK", value / 255, texture=texture)), (-1.0, WALL), size=2.5)
        assert (sheets_of(sample(scene, CAMERA)) == 0).all() and len(sample_layers(scene, CAMERA)) == 1


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("per_pixel", [1, 2])
def test_layers_are_those_of_triangles_drawn_one_by_one(seed, per_pixel):
    random = np.random.default_rng(seed)
    count = 40
    centers = np.repeat(random.uniform(-1.5, 1.5, (count, 3)), 3, axis=0)
    positions = (centers + random.uniform(-3, 3, (3 * count, 3))).astype(np.float32)
    materials = [WALL, PANE, GLASS, NOTHING, CLEAR_GLASS]
    ids = random.choice(5, count, p=[0.05, 0.45, 0.3, 0.1, 0.1])
    scene = Scene(positions, np.arange(3 * count).reshape(-1, 3), materials, ids)
    camera = Camera.look_at((0.5, 1, 4), (0, 0, 0), fov_y=60.0, width=40, height=30)
    alone = [sample(Scene(positions, [t]), camera, per_pixel) for t in scene.triangles]
    depth = np.stack([samples.depth for samples in alone], axis=-1)
    depth[..., ids == 3] = np.inf
    order = np.argsort(depth, axis=-1, kind="stable")
    there = np.isfinite(np.take_along_axis(depth, order, axis=-1))
    before = np.cumsum((ids == 0)[order] & there, axis=-1) - ((ids == 0)[order] & there)
    expected = np.where(there & (before == 0), order, -1)
    layers = sample_layers(scene, camera, 50, per_pixel)
    assert len(layers) == (expected >= 0).any(axis=tuple(range(expected.ndim - 1))).sum() > 7
    for number, layer in enumerate(layers):
        np.testing.assert_array_equal(layer.triangle, expected[..., number])
        for t in np.unique(layer.triangle[layer.covered]):
            at = layer.triangle == t
            for name in ARRAYS[1:]:
                np.testing.assert_array_equal(getattr(layer, name)[at], getattr(alone[t], name)[at])


def test_the_number_of_threads_changes_nothing(monkeypatch):
    scene = squares((0.0, GLASS), (-0.5, PANE), (-1.0, WALL), size=1.5)
    found = []
    for threads in ("1", "4"):
        monkeypatch.setenv("UMBRAE_THREADS", threads)
        found.append([*sample_layers(scene, CAMERA, 8, 2), sample_stochastic(scene, CAMERA, 4, 9)])
    assert len(found[0]) == 4
    for one, other in zip(*found, strict=True):
        check_same(one, other)
    assert found[0][3].throughput.tobytes() == found[1][3].throughput.tobytes()


def test_bad_questions_are_refused(monkeypatch):
    scene = squares((0.0, PANE), (-1.0, WALL))
    for wrong in (0, -1, 2.0, "8", True):
        with pytest.raises(OptionError, match="layers: wanted a whole number from 1"):
            sample_layers(scene, CAMERA, wrong)
    for wrong in (-1, 1.5, "x", 1 << 63):
        with pytest.raises(OptionError, match="seed: wanted a whole number from 0"):
            sample_stochastic(scene, CAMERA, 4, wrong)
    with pytest.raises(OptionError, match="samples_per_pixel"):
        sample_stochastic(scene, CAMERA, 0)
    texture = np.array([[(255, 255, 255, 0), (255, 255, 255, 255)]], np.uint8)
    bare = Scene(scene.positions, scene.triangles, [Material(alpha_mode="BLEND", texture=texture)])
    with pytest.raises(InputError, match="no texture coordinates"):
        sample_layers(bare, CAMERA)
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), width=512, height=512)
    monkeypatch.setattr(umbrae.memory, "available_bytes", lambda: 10 << 20)
    assert len(sample_layers(scene, camera, 8)) == 2
    sizes = iter([16 << 20, 1 << 20])  # for the picture, another layer
    monkeypatch.setattr(umbrae.memory, "available_bytes", lambda: next(sizes))
    monkeypatch.setenv("UMBRAE_THREADS", "1")
    with pytest.raises(CapacityError, match="layer 2 of a picture of 512 x 512 pixels with 2 samples each"):
        sample_layers(scene, camera, 8, 2)


def test_layers_that_do_not_fit_are_refused_before_the_first(monkeypatch):
    scene = squares((0.0, PANE), (-0.5, PANE), (-1.0, WALL))
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), width=512, height=384)
    one, drawn, draw = 512 * 384 * BYTES_PER_SAMPLE, [], layers_module.Bands.draw
    monkeypatch.setattr(
        layers_module.Bands, "draw", lambda self, *what: drawn.append(self.picture.width) or draw(self, *what)
    )

    def offer(layers):
        drawn.clear()
        for module in (umbrae.memory, layers_module):
            monkeypatch.setattr(module, "available_bytes", lambda: int(layers * one))

    offer(9)
    assert len(sample_layers(scene, camera, 8)) == 3 and set(drawn) == {512}
    offer(3.5)  # eight would not fit, but there are three
    assert len(sample_layers(scene, camera, 8)) == 3 and set(drawn) == {512, 128}
    offer(2.5)
    with pytest.raises(
        CapacityError, match=r"a picture of 512 x 384 pixels with 1 samples each in 3 layers \(fewer need"
    ):
        sample_layers(scene, camera, 8)
    assert set(drawn) == {128}
    offer(2.5)
    assert len(sample_layers(scene, camera, 2)) == 2 and set(drawn) == {512}


# By chance


def test_without_transparency_chance_has_no_say():
    scene = squares((0.0, WALL), (-1.0, PANE), size=1.0)
    seen = sample_stochastic(scene, CAMERA, 4, seed=3)
    check_same(seen, sample(scene, CAMERA, 4))
    assert seen.throughput.shape == (31, 31, 4, 3) and (seen.throughput == 1).all()


@pytest.mark.parametrize(("alpha", "few", "many"), [(0.25, 4, 4), (0.5, 8, 8), (0.3, 4, 5), (1 / 255, 0, 1)])
def test_each_pixel_shows_its_share_of_a_pane(alpha, few, many):
    """Of 16 samples that meet one triangle, alpha times 16 see it: rounded, in no pixel farther off."""
    scene = Scene(
        [(-30, -30, 0), (30, -30, 0), (0, 60, 0), (-30, -30, -1), (30, -30, -1), (0, 60, -1)],
        [(0, 1, 2), (3, 4, 5)],
        [Material((1, 1, 1, alpha), "BLEND"), WALL],
        [0, 1],
    )
    seen = sample_stochastic(scene, CAMERA, 16, seed=1)
    assert seen.covered.all() and (seen.throughput == 1).all()
    count = (seen.triangle == 0).sum(axis=2)
    assert count.min() >= few and count.max() <= many
    # 961 pixels: the mean of rounded numbers is off by less than 5 of its standard deviations, at most 0.5 / 31 each
    assert abs(count.mean() - 16 * alpha) <= 5 * 0.5 / 31
    for k in range(16):  # and no place in the pixel is preferred
        assert abs((seen.triangle[..., k] == 0).mean() - alpha) <= 5 * np.sqrt(alpha * (1 - alpha)) / 31


def test_chances_at_several_surfaces_are_independent():
    scene = squares((1.0, PANE), (0.0, PANE), (-1.0, PANE), (-2.0, WALL), size=20.0)
    seen = sample_stochastic(scene, CAMERA, 9, seed=5)
    shares = np.bincount(sheets_of(seen).reshape(-1), minlength=4) / seen.size
    expected = np.array([0.25, 0.75 * 0.25, 0.75**2 * 0.25, 0.75**3])
    # Stratified chances vary less than free ones, whose standard deviation this is.
    assert (np.abs(shares - expected) <= 5 * np.sqrt(expected * (1 - expected) / seen.size)).all()


def test_the_seed_decides():
    scene = squares((0.0, PANE), (-1.0, WALL))
    one, same, other = (sample_stochastic(scene, CAMERA, 4, seed) for seed in (0, 0, 1))
    check_same(one, same)
    differ = (one.triangle != other.triangle).mean()
    assert 0.25 < differ < 0.5  # 2 * 0.25 * 0.75


def test_weights_make_the_mean_of_coloured_glass_right():
    """What passes, what is mirrored and what is shed add up to what layers put together say, channel by channel."""
    tint, sheet = np.array([0.9, 0.5, 0.1]), Material((0.9, 0.5, 0.1, 0.6), "BLEND", transmission=0.8)
    scene = squares((1.0, sheet), (0.0, sheet), (-1.0, WALL), size=100.0)
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), fov_y=1.0, width=32, height=32)  # looks squarely everywhere
    seen = sample_stochastic(scene, camera, 64, seed=2)
    weight = seen.throughput.astype(np.float64)
    # What is shed counts up to 1 / (1 - 0.8 * 0.96 * 0.9), of a surface that is 0.2 diffuse and mirrors 0.8 * 0.04.
    assert 3 < weight.max() < 3.24 and weight.min() >= 0.0
    passes = 0.4 + 0.6 * 0.8 * 0.96 * tint
    for number, expected in enumerate((np.full(3, 0.6), 0.6 * passes, passes**2)):
        found = (weight * (sheets_of(seen) == number)[..., None]).mean(axis=(0, 1, 2))
        spread = (weight * (sheets_of(seen) == number)[..., None]).std(axis=(0, 1, 2))
        assert (np.abs(found - expected) <= 5 * spread / np.sqrt(seen.size)).all()


@pytest.mark.parametrize("per_pixel", [1, 2, 7, 16, 64])
@pytest.mark.parametrize("seed", [0, 2**62 + 12345])
def test_chances_of_a_pixel_lie_one_in_each_stratum(per_pixel, seed):
    samples = np.arange(2000 * per_pixel)
    # At one triangle, at another, and at the first again on the way to the light.
    given = (0, VIEW), (1, VIEW), (0, LIGHT)
    found = np.stack(
        [chances(key_of(seed, purpose), np.full(len(samples), t, np.int32), samples, per_pixel) for t, purpose in given]
    ).reshape(3, 2000, per_pixel)
    strata = np.sort((found * per_pixel).astype(int), axis=2)
    np.testing.assert_array_equal(strata, np.broadcast_to(np.arange(per_pixel), strata.shape))
    assert found.min() >= 0 and found.max() < 1
    # Uniform for each sample of a pixel, and independent of that at another triangle: 5 standard deviations.
    assert np.abs(found.mean(axis=1) - 0.5).max() <= 5 / np.sqrt(12 * 2000)
    for one, other in ((0, 1), (0, 2)):
        product = ((found[one] - 0.5) * (found[other] - 0.5)).mean(axis=0)
        assert np.abs(product).max() <= 5 / 12 / np.sqrt(2000)


def test_rows_keep_what_samples_count():
    seen = sample_stochastic(squares((0.0, GLASS), (-1.0, WALL)), CAMERA, 4)
    assert (seen.rows(3, 7).throughput == seen.throughput[3:7]).all()


def test_textures_are_looked_up_as_shadows_do():
    """A known answer for `passing`, by the formula: texture times base colour, alpha 0.5 and glass of half a share."""
    texture = np.full((2, 2, 4), (255, 188, 0, 128), np.uint8)
    texture[0, 0] = 255
    scene = squares((0.0, Material((0.5, 1, 1, 1), "BLEND", transmission=0.5, texture=texture)))
    found = np.empty((1, 3))
    passing_at(scene.triangles, transmission_of(scene), np.zeros(1, np.int32), np.full((1, 2), 0.25, np.float32), found)
    u, v = 0.25 * 1, 0.25 + 0.25
    red, green, blue, alpha = fetch.py_func(*pack([texture]), 0, u, v)
    expected = (1 - alpha) + alpha * 0.5 * np.array([0.5 * red, green, blue])
    np.testing.assert_allclose(found[0], expected, rtol=1e-6)
