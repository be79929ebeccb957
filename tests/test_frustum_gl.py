"""Shadow frusta on the GPU: the tree and the planes against numpy, the masks against the CPU's and the oracle's."""

import dataclasses
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from soups import SOUPS
from test_twins import triangles_of
from umbrae import (
    METHODS,
    Camera,
    GraphicsError,
    InputError,
    Light,
    OptionError,
    Scene,
    ViewSamples,
    models,
    sample,
    verify,
)
from umbrae.clock import Clock
from umbrae.geometry.chance import MOST_STRATA
from umbrae.geometry.predicates import plane_value, side_value
from umbrae.geometry.volume_faces import facing_of_all
from umbrae.gl.program import program
from umbrae.methods.frustum_gl import caster as frames
from umbrae.methods.frustum_gl import layout
from umbrae.methods.frustum_gl.tiles import tiles_of

HERE = Path(__file__).parent
pytestmark = pytest.mark.usefixtures("opengl")


def prepared(scene, **options):
    return METHODS["frustum-gl"](**options).prepare(scene)


def picture_of(scene, width=90, height=60, per_pixel=1):
    return sample(scene, Camera.frame(scene, width=width, height=height), per_pixel)


def light_over(scene, shift=(3.0, 25.0, 8.0)):
    return Light.point(scene.bounds.mean(axis=0).astype(float) + shift)


@pytest.fixture(scope="module")
def spheres():
    return models.spheres((4, 4), 3000)


@pytest.fixture(scope="module")
def pavilion():
    return models.pavilion().opaque()


# The predicate


@pytest.mark.parametrize(
    "kind", ["point", "directional", "nearly edge-on", "slivers", "lattice", "tiny", "light far away"]
)
def test_the_predicate_is_that_of_the_cpu(opengl, kind):
    rng = np.random.default_rng(5)
    corners, light = triangles_of(kind, rng, 4000)
    if kind == "tiny":  # below 2^-126, where drivers may see zeros
        corners, light[:3] = corners * np.float32(1e-20), light[:3] * np.float32(1e-20)
    size = np.abs(corners).max()
    points = rng.uniform(-size, size, (len(corners), 1, 3)).astype(np.float32)
    points[::2, 0] = corners[::2, 1]  # on the planes
    with opengl.current():
        shader = program(opengl, HERE / "predicates_twin.glsl")
        given = opengl.moderngl.buffer(np.concatenate([corners, points], axis=1).tobytes())
        found, sides = (
            opengl.moderngl.buffer(reserve=64 * len(corners)),
            opengl.moderngl.buffer(reserve=4 * len(corners)),
        )
        for binding, buffer in enumerate((given, found, sides)):
            buffer.bind_to_storage_buffer(binding)
        shader["count"].value, shader["light"].value = len(corners), tuple(light.astype(float).tolist())
        shader.run(-(-len(corners) // 64))
        opengl.moderngl.memory_barrier()
        values, sides = np.frombuffer(found.read()).reshape(-1, 4, 2), np.frombuffer(sides.read(), np.int32)
    positions, triangles = corners.reshape(-1, 3), np.arange(corners.size // 3, dtype=np.int32).reshape(-1, 3)
    truth = facing_of_all(positions, triangles, light)
    assert ((sides == truth) | (sides == 2)).all()
    # What is exactly edge-on is seen as such only where all products are zero.
    assert (sides[truth != 0] == 2).sum() <= {"nearly edge-on": 20, "slivers": 20}.get(kind, 0)
    for t in range(0, len(corners), 40):
        i, j, k = triangles[t]
        point, source = points[t, 0].astype(float), light.astype(float)
        twins = [side_value(positions, *edge, source, point, 0.0) for edge in ((i, j), (j, k), (k, i))]
        twins.append(plane_value(positions, i, j, k, point, 0.0))
        np.testing.assert_array_equal(values[t, :, 0], [value for value, _ in twins])
        np.testing.assert_allclose(values[t, :, 1], [bound for _, bound in twins], rtol=1e-15)  # other order of sums


# The tree


@pytest.mark.parametrize(
    ("width", "height", "per_pixel"), [(1, 1, 1), (8, 4, 1), (33, 17, 1), (70, 41, 3), (30, 20, 4), (300, 9, 1)]
)
def test_the_tree_holds_the_lit_samples(opengl, spheres, width, height, per_pixel):
    light, samples = light_over(spheres), picture_of(spheres, width, height, per_pixel)
    made = prepared(spheres)
    uploads = made.upload(samples)
    band, tiles = uploads.bands[0], uploads.bands[0].part.tiles
    with opengl.current():
        made._face(light)
        made.passes.build(band)
        boxes, words = made.passes.tree(tiles)
    facing = facing_of_all(spheres.positions, spheres.triangles, light.position)
    lit = samples.covered & (facing[samples.triangle] * samples.side >= 0)
    camera = samples.camera
    relative = samples.position - camera.eye
    x, y, w = np.moveaxis(relative @ camera.world_to_clip[:, :3].T, -1, 0)
    unit = uploads.view.uniforms(made._reach)["unit"]
    grid = as_grid(np.stack([x / w, y / w, unit / w], axis=-1), tiles), as_grid(lit, tiles)
    asked = 0
    for level in range(1, tiles.depth + 1):
        columns, rows, word, place = tiles.levels[level]
        covers = np.prod([shape(below) for below in range(1, level + 1)], axis=0)
        above = shape(level + 1)
        for number in range(columns * rows):
            node = np.array([number % columns, number // columns])
            part = tuple(slice(*(covers[axis] * (node[axis] + [0, 1]))) for axis in (1, 0))
            inside = grid[0][part][grid[1][part]]
            parent = node // above
            lane = (node - parent * above) @ [1, above[0]]
            at = place + 32 * (parent[1] * -(-columns // above[0]) + parent[0]) + lane
            assert (words[word + number] != 0) == (len(inside) > 0)
            if level == 1:
                bits = np.zeros((4, 8), bool)
                bits[: grid[1][part].shape[0], : grid[1][part].shape[1]] = grid[1][part]
                assert words[word + number] == np.packbits(bits, bitorder="little").view(np.uint32)[0]
            if len(inside):
                # Positions are rounded to float32 here, relative to the largest coordinate.
                np.testing.assert_allclose(boxes[at, 0, :3], inside.min(axis=0), rtol=0, atol=2e-5 * unit / w.min())
                np.testing.assert_allclose(boxes[at, 1, :3], inside.max(axis=0), rtol=0, atol=2e-5 * unit / w.min())
                asked += 1
            else:
                assert (boxes[at, 0, :3] > boxes[at, 1, :3]).all()
    assert asked > 0


def shape(level):
    """Width and height of a node in nodes of the level below."""
    return (8, 4) if level % 2 else (4, 8)


def as_grid(values, tiles):
    """A picture's values with the samples of each pixel side by side."""
    width, per_pixel, across, down = tiles.pixels
    height = values.shape[0]
    rest = values.shape[3 if per_pixel > 1 else 2 :]
    parts = values.reshape(height, width, down, across, *rest)
    return np.moveaxis(parts, 2, 1).reshape(height * down, width * across, *rest)


def test_tiles_take_32_samples_and_no_more_than_needed():
    tiles = tiles_of(1024, 1024, 1)
    assert tiles.levels[: tiles.depth + 1, :2].tolist() == [[1024, 1024], [128, 256], [32, 32], [4, 8], [1, 1]]
    assert (tiles.depth, tiles.places, tiles.words) == (4, 1 << 20, 32768 + 1024 + 32 + 1)
    assert tiles_of(1, 1, 1).depth == 1
    assert tiles_of(65536, 128, 1).depth < len(tiles.levels) - 1
    assert tiles_of(10, 10, 7).pixels == (10, 7, 1, 7) and tiles_of(10, 10, 16).pixels == (10, 16, 4, 4)


# The planes


@pytest.mark.parametrize("kind", ["point", "inside", "directional", "far"])
def test_planes_say_nothing_that_is_wrong(opengl, kind):
    rng = np.random.default_rng(3)
    corners = rng.uniform(-1, 1, (50, 1, 3)) + rng.uniform(0.01, 1, (50, 1, 1)) * rng.normal(0, 0.5, (50, 3, 3))
    scene = Scene(corners.reshape(-1, 3).astype(np.float32) + np.float32(512), np.arange(150).reshape(-1, 3))
    middle, extent = scene.bounds.mean(axis=0).astype(float), float(np.ptp(scene.bounds))
    light = {
        "point": Light.point(middle + extent * np.array([0.3, 0.9, 0.2])),
        "inside": Light.point(middle + extent * np.array([0.01, 0.02, 0.03])),
        "directional": Light.directional((-0.35, -1.0, -0.2)),
        "far": Light.point(middle + 1e6 * extent * np.array([0.3, 0.9, 0.2])),
    }[kind]
    samples = picture_of(scene, 24, 16)
    made = prepared(scene)
    uploads = made.upload(samples)
    made.shadow_on_gpu(light, uploads)
    with opengl.current():
        rows, places = made.passes.frusta(), made.passes.places(uploads.bands[0])
    assert 20 < len(rows) <= len(scene.triangles)
    facing = facing_of_all(scene.positions, scene.triangles, light.position)
    chosen = np.flatnonzero(samples.covered.reshape(-1))[::7]
    tiles = uploads.bands[0].part.tiles
    index = as_grid(np.arange(samples.size).reshape(samples.shape), tiles)
    flat = samples.take(chosen)
    said = decided = 0
    for row in rows[::5]:
        planes, caster = row[:24].view(np.float32), int(row[44])
        t, toward = caster >> 2, facing[caster >> 2]
        assert (caster & 1) == (toward > 0)
        corners = [[Fraction(float(x)) for x in scene.positions[v]] for v in scene.triangles[t]]
        for s, where in enumerate(chosen):
            y, x = np.argwhere(index == where)[0]
            place = places[32 * (y // 4 * int(tiles.levels[1, 0]) + x // 8) + y % 4 * 8 + x % 8]
            x, y, q = place[:3].view(np.float32).astype(float)
            assert place[3] == flat.triangle[s]
            exact = exact_signs(corners, light, scene, flat, s)
            for plane in range(4):
                n = planes[4 * plane : 4 * plane + 4].astype(float)
                value, bound = n @ (x, y, 1, q), planes[16 + plane] + planes[20 + plane] * q
                said += 1
                if abs(value) > bound:
                    decided += 1
                    assert np.sign(value) == -toward * exact[plane], f"triangle {t}, sample {where}, plane {plane}"
    assert decided > 0.95 * said, "the bounds leave too much open"


def exact_signs(corners, light, scene, samples, s):
    """On which side of three side planes and a triangle's own a sample is, in rational numbers."""
    a, b, c = ([Fraction(float(x)) for x in scene.positions[v]] for v in scene.triangles[samples.triangle[s]])
    u, v = (Fraction(float(x)) for x in samples.barycentric[s])
    point = [a[i] + u * (b[i] - a[i]) + v * (c[i] - a[i]) for i in range(3)]
    source, w = [Fraction(float(x)) for x in light.position[:3]], Fraction(float(light.position[3]))
    signs = []
    for i in range(4):
        p, q = corners[i % 3], corners[(i + 1) % 3]
        r = [w * p[x] - source[x] for x in range(3)] if i < 3 else [q[x] - p[x] for x in range(3)]
        e = [q[x] - p[x] for x in range(3)] if i < 3 else [corners[2][x] - p[x] for x in range(3)]
        d = [point[x] - p[x] for x in range(3)]
        n = [r[1] * e[2] - r[2] * e[1], r[2] * e[0] - r[0] * e[2], r[0] * e[1] - r[1] * e[0]]
        value = sum(n[x] * d[x] for x in range(3))
        signs.append((value > 0) - (value < 0))
    return signs


# The masks


def same_as_the_cpu(scene, light, samples, **options):
    mask = prepared(scene, **options).shadow(light, samples)
    truth = METHODS["frustum"]().prepare(scene).shadow(light, samples)
    np.testing.assert_array_equal(mask.in_shadow, truth.in_shadow)
    return mask


@pytest.mark.parametrize("silhouette_planes", [False, True])
@pytest.mark.parametrize("skip_full", [False, True])
@pytest.mark.parametrize("front_face_culling", [False, True])
def test_options_do_not_change_the_mask(spheres, silhouette_planes, skip_full, front_face_culling):
    options = {
        "silhouette_planes": silhouette_planes, "skip_full": skip_full, "front_face_culling": front_face_culling
    }  # fmt: skip
    mask = same_as_the_cpu(spheres, light_over(spheres), picture_of(spheres), **options)
    assert 100 < mask.in_shadow.sum() < mask.in_shadow.size // 2


def test_each_option_saves_tests(spheres):
    light, samples = light_over(spheres), picture_of(spheres)
    plain = {"silhouette_planes": False, "skip_full": False, "front_face_culling": False}
    before = prepared(spheres, **plain).shadow(light, samples).stats
    for option in plain:
        stats = prepared(spheres, **{**plain, option: True}).shadow(light, samples).stats
        assert stats["sample_frustum_tests"] < before["sample_frustum_tests"], option
    assert all(before[name] > 0 for name in ("tile_frustum_tests", "sample_frustum_tests", "accepts", "rejects"))
    assert before["accepts"] + before["rejects"] < before["tile_frustum_tests"] + before["sample_frustum_tests"]


@pytest.mark.parametrize(
    ("width", "height", "per_pixel"), [(1, 1, 1), (33, 17, 1), (257, 130, 1), (40, 30, 4), (31, 9, 7), (700, 3, 2)]
)
def test_pictures_of_any_size(spheres, width, height, per_pixel):
    mask = same_as_the_cpu(spheres, light_over(spheres), picture_of(spheres, width, height, per_pixel))
    assert mask.in_shadow.shape == ((height, width) if per_pixel == 1 else (height, width, per_pixel))


@pytest.mark.parametrize(
    "light",
    [
        Light.point((0.2, 1.3, 0.4)),
        Light.directional((0.0, -1.0, 0.0)),
        Light.directional((-0.4, -1.0, 0.3)),
        Light.point((0.0, -30.0, 0.0)),
        Light.point((1e6, 3e6, 2e6)),
    ],
)
def test_lights_anywhere(pavilion, light):
    same_as_the_cpu(pavilion, light, picture_of(pavilion))


def test_an_eye_in_shadow_and_one_at_the_light(spheres):
    light = light_over(spheres)
    low, high = spheres.bounds.astype(float)
    under = Camera.look_at(low + np.array([1.4, 0.2, 1.4]), (low + high) / 2, fov_y=70, width=80, height=50)
    same_as_the_cpu(spheres, light, sample(spheres, under))
    at = Camera.look_at(light.position[:3].astype(float), (low + high) / 2, width=80, height=50)
    mask = same_as_the_cpu(spheres, light, sample(spheres, at))
    # Seen from the light itself all is lit, but for samples that rounding has moved behind an outline.
    assert mask.in_shadow.sum() <= 20


@pytest.mark.parametrize("name", ["coplanar_overlap", "cube", "mixed_scales"])
def test_what_float64_leaves_open_is_decided_exactly(name):
    soup = SOUPS[name]
    samples = sample(soup.scene, Camera.look_at(soup.eye, soup.target, fov_y=60, width=40, height=30))
    a, b, c = soup.scene.positions[soup.scene.triangles[-1]].astype(float)
    asked = 0
    for light in (Light.point(a + 2 * (b - a) + 4 * (c - a)), Light.point(a), light_over(soup.scene)):
        mask = prepared(soup.scene).shadow(light, samples)
        assert verify(soup.scene, light, samples, mask).ok
        asked += mask.stats["predicate_fallbacks"]
    assert asked > 0 or name != "coplanar_overlap"


def test_samples_that_the_picture_does_not_hold_are_asked_all_the_same():
    spheres = models.spheres((2, 2), 200)
    # A triangle so large that its barycentrics step over many pixels beside the eye.
    ground = np.array([[-4e6, 0, -4e6], [4e6, 0, -4e6], [0, 0, 6e6]], np.float32)
    scene = Scene(
        np.concatenate([spheres.positions, ground]),
        np.concatenate([spheres.triangles, len(spheres.positions) + np.arange(3).reshape(1, 3)]),
    )
    eye = np.array([0.0, 0.02, -9.0])
    samples = sample(
        scene, Camera.look_at(eye, eye + np.array([0.0, -0.01, 1.0]), fov_y=80, width=64, height=48, near=1e-3)
    )
    relative = samples.position - eye
    w = relative @ samples.camera.axes[2]
    aside = np.abs(relative @ samples.camera.world_to_clip[0, :3]) > 2 * w
    assert (aside & samples.covered).any()
    for light in (light_over(spheres), Light.point((0.0, 0.5, -9.1))):
        same_as_the_cpu(scene, light, samples)


def test_a_frustum_may_have_to_visit_every_tile():
    # A plate just above all that is seen: no tile is so flat that it lies between the two.
    corners = np.array([[-30, 0, -30], [30, 0, -30], [0, 0, 60]], np.float32)
    scene = Scene(np.concatenate([corners, corners * 2 + [0, 2e-3, 0]]), [[0, 2, 1], [3, 5, 4]])
    ground = Scene(corners, [[0, 2, 1]])
    samples = sample(ground, Camera.look_at((0, 4, -5), (0, 0, 0), width=1024, height=600))
    light = Light.point((1, 50, 2))
    mask = prepared(scene).shadow(light, samples)
    np.testing.assert_array_equal(mask.in_shadow, samples.covered)
    assert mask.stats["sample_frustum_tests"] > 0.9 * samples.covered.sum()
    assert samples.covered.mean() > 0.5


def test_samples_are_uploaded_once_for_many_lights(opengl, spheres):
    samples = picture_of(spheres)
    made = prepared(spheres)
    uploads = made.upload(samples)
    for light in (light_over(spheres), Light.directional((1, -2, 1))):
        on_gpu = made.shadow_on_gpu(light, uploads)
        truth = METHODS["frustum"]().prepare(spheres).shadow(light, samples).in_shadow
        with opengl.current():
            found = np.frombuffer(on_gpu.verdicts[0].read(samples.size), np.uint8)
        np.testing.assert_array_equal(found.reshape(samples.shape), truth)
        np.testing.assert_array_equal(on_gpu.mask().in_shadow, truth)
    with pytest.raises(InputError, match="uploaded by another caster"):
        prepared(spheres).shadow_on_gpu(light, uploads)


def test_stages_are_spans_with_times_of_the_gpu(spheres):
    clock = Clock()
    prepared(spheres).shadow(light_over(spheres), picture_of(spheres, 16, 16), clock)
    stages = {"upload", "facing", "hierarchy", "setup", "traversal", "decide", "merge"}
    assert stages | {f"gpu {name}" for name in stages} | {"read"} <= set(clock.seconds())


# Little room


def test_bands_of_a_picture_make_the_same_mask(monkeypatch, spheres):
    light, samples = light_over(spheres), picture_of(spheres, 70, 50, 2)
    monkeypatch.setattr(layout, "BLOCK", 2500)
    assert len(prepared(spheres).upload(samples).bands) == 8
    same_as_the_cpu(spheres, light, samples)


def test_lists_that_are_too_short_grow(monkeypatch):
    soup = SOUPS["coplanar_overlap"]
    samples = sample(soup.scene, Camera.look_at(soup.eye, soup.target, fov_y=60, width=300, height=140))
    light = light_over(soup.scene)
    monkeypatch.setattr(frames, "ROOM", 1)
    assert same_as_the_cpu(soup.scene, light, samples).stats["fallbacks"] > 100
    made = prepared(soup.scene)
    most = made.passes.most
    made.passes.most = 8 * 8  # no room for all of them at once: fewer triangles then
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(layout, "rows_of_band", lambda width, height, per_pixel, most_bytes: height)
        uploads = made.upload(samples)
    made.passes.most = most
    assert made.shadow_on_gpu(light, uploads).stats["fallbacks"] > 100


# What is refused


def test_what_does_not_fit_is_refused_beforehand(opengl, monkeypatch, spheres):
    monkeypatch.setattr(type(opengl), "integer", lambda self, name: 10_000)
    with pytest.raises(GraphicsError, match=r"frustum-gl: an array of this scene has \d+ bytes.*takes 10000"):
        prepared(spheres)
    few = SOUPS["one_triangle"].scene
    with pytest.raises(GraphicsError, match="frustum-gl: a row of 900 pixels with 1 samples each"):
        prepared(few).upload(picture_of(few, 900, 2))


def test_more_samples_in_a_pixel_than_chances_can_tell_apart(spheres):
    points = ViewSamples.points(np.zeros((1, 1, MOST_STRATA + 1, 3)))
    samples = dataclasses.replace(points, camera=Camera.look_at((0, 5, 5), (0, 0, 0), width=1, height=1))
    with pytest.raises(InputError, match="frustum-gl: wanted up to 65536 samples per pixel, got 65537"):
        prepared(spheres).shadow(light_over(spheres), samples)


@pytest.mark.parametrize("options", [{"transparency": "sorted"}, {"seed": -1}, {"seed": 1 << 63}])
def test_options_out_of_range(options):
    with pytest.raises(OptionError, match=r"frustum-gl: (transparency|seed)"):
        METHODS["frustum-gl"](**options)


def test_a_scene_without_triangles():
    scene = Scene(np.zeros((0, 3)), np.zeros((0, 3), int))
    samples = sample(scene, Camera.look_at((0, 0, 5), (0, 0, 0), width=8, height=8))
    assert not prepared(scene).shadow(Light.point((1, 2, 3)), samples).in_shadow.any()


def test_equal_triangles_are_one_surface_without_exact_arithmetic(spheres):
    twice = Scene(spheres.positions, np.concatenate([spheres.triangles, spheres.triangles[:, [1, 0, 2]]]))
    samples = picture_of(twice, 60, 40)
    mask = same_as_the_cpu(twice, light_over(twice), samples)
    assert mask.stats["fallbacks"] > 100 and mask.stats["predicate_fallbacks"] == 0
