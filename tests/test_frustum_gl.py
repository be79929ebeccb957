"""Shadow frusta on the GPU: the tree and the planes against numpy, the masks against the CPU's and the oracle's."""

import dataclasses
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from soups import SOUPS
from test_twins import triangles_of
from umbrae import METHODS, Camera, GraphicsError, InputError, Light, Scene, ViewSamples, models, sample, verify
from umbrae.clock import Clock
from umbrae.geometry.predicates import hit_weights, plane_value, shadows, side_value
from umbrae.geometry.volume_faces import facing_of_all
from umbrae.gl.program import program
from umbrae.material import Material
from umbrae.methods.frustum_gl import caster as frames
from umbrae.methods.frustum_gl import uploaded
from umbrae.methods.frustum_gl.tiles import shape, tiles_of
from umbrae.transmission import CLEAR, EVEN, SOLID, VARYING, passing, transmission_of

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


@pytest.mark.parametrize(
    "light", [Light.directional((0, -1, 0)), Light.directional((1, -2, -1)), Light.point((2, 3, 2))]
)
@pytest.mark.parametrize("alpha_mode", ["BLEND", "MASK"])
def test_an_edge_of_the_own_pane_counts_once(alpha_mode, light):
    # A sheet seen from below, and each sample moved to an edge of its triangle.
    grid = np.linspace(0, 4, 5)
    positions = [(x, 1.0, z) for z in grid for x in grid]
    quads = [(a, a + 1, a + 5, a + 6) for a in (5 * j + i for j in range(4) for i in range(4))]
    triangles = [t for a, b, c, d in quads for t in ((a, c, d), (a, d, b))]
    scene = Scene(np.array(positions), triangles, [Material((0.5, 0.5, 0.5, 0.5), alpha_mode, alpha_cutoff=0.25)])
    scene = scene if alpha_mode == "BLEND" else dataclasses.replace(
        scene, materials=[Material((1, 1, 1, 1), "MASK", texture=np.array([[[255] * 4, [255] * 3 + [0]]], np.uint8))],
        uv=np.full((25, 2), 0.25),
    )  # fmt: skip
    samples = sample(scene, Camera.look_at((2, -3, 2.01), (2, 1, 2), fov_y=40, width=48, height=40))
    uv = samples.barycentric.copy()
    uv[::3, :, 0] = 0
    uv[1::3, :, 1] = 0
    uv[2::3, :, 1] = 1 - uv[2::3, :, 0]
    on_edge = ViewSamples.on_surface(scene, samples.triangle[samples.covered], uv[samples.covered], 1)
    position = samples.position.copy()
    position[samples.covered] = on_edge.position
    samples = dataclasses.replace(samples, barycentric=uv, position=position)
    inner = samples.covered & ((position[..., [0, 2]] > 0.01) & (position[..., [0, 2]] < 3.99)).all(axis=-1)
    assert inner.sum() > 500
    mask = prepared(scene).shadow(light, samples)
    np.testing.assert_allclose(mask.transmittance[inner], 0.5 if alpha_mode == "BLEND" else 0, rtol=0, atol=1e-5)
    assert verify(scene, light, samples, mask).ok


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
    band = made.upload(samples).bands[0]
    with opengl.current():
        made._face(light)
        made.passes.build(band)
        boxes, words = made.passes.tree(band.tiles)
    facing = facing_of_all(spheres.positions, spheres.triangles, light.position)
    lit = samples.covered & (facing[samples.triangle] * samples.side >= 0)
    camera = samples.camera
    relative = samples.position - camera.eye
    x, y, w = np.moveaxis(relative @ camera.world_to_clip[:, :3].T, -1, 0)
    unit = made._view(camera)["unit"]
    grid = as_grid(np.stack([x / w, y / w, unit / w], axis=-1), band.tiles), as_grid(lit, band.tiles)
    asked = 0
    for level in range(1, band.tiles.depth + 1):
        columns, rows, word, place = band.tiles.levels[level]
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
    index = as_grid(np.arange(samples.size).reshape(samples.shape), uploads.bands[0].tiles)
    flat = samples.take(chosen)
    said = decided = 0
    for row in rows[::5]:
        planes, caster = row[:24].view(np.float32), int(row[44])
        t, toward = caster >> 2, facing[caster >> 2]
        assert (caster & 1) == (toward > 0)
        corners = [[Fraction(float(x)) for x in scene.positions[v]] for v in scene.triangles[t]]
        for s, where in enumerate(chosen):
            y, x = np.argwhere(index == where)[0]
            tiles = uploads.bands[0].tiles
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
    monkeypatch.setattr(uploaded, "BLOCK", 2500)
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
        patch.setattr(uploaded, "rows_of_band", lambda camera, per_pixel, most_bytes: camera.height)
        patch.setattr(frames, "rows_of_band", lambda camera, per_pixel, most_bytes: camera.height)
        uploads = made.upload(samples)
    made.passes.most = most
    assert made.shadow_on_gpu(light, uploads).stats["fallbacks"] > 100


# What is refused


def test_points_are_refused(spheres):
    made = prepared(spheres)
    with pytest.raises(InputError, match=r"frustum-gl: wanted the samples of a whole picture.*frustum"):
        made.shadow(light_over(spheres), ViewSamples.points([[0, 1, 2]]))
    samples = picture_of(spheres, 8, 8)
    lost = dataclasses.replace(samples, triangle=np.full((8, 8), -1, np.int32), covered=np.ones((8, 8), bool))
    with pytest.raises(InputError, match="frustum-gl: sample 0 lies on no triangle"):
        made.shadow(light_over(spheres), lost)


def test_what_does_not_fit_is_refused_beforehand(opengl, monkeypatch, spheres):
    monkeypatch.setattr(type(opengl), "integer", lambda self, name: 10_000)
    with pytest.raises(GraphicsError, match=r"frustum-gl: an array of this scene has \d+ bytes.*takes 10000"):
        prepared(spheres)
    few = SOUPS["one_triangle"].scene
    with pytest.raises(GraphicsError, match="frustum-gl: a row of 900 pixels with 1 samples each"):
        prepared(few).upload(picture_of(few, 900, 2))


def test_a_scene_without_triangles():
    scene = Scene(np.zeros((0, 3)), np.zeros((0, 3), int))
    samples = sample(scene, Camera.look_at((0, 0, 5), (0, 0, 0), width=8, height=8))
    assert not prepared(scene).shadow(Light.point((1, 2, 3)), samples).in_shadow.any()


# What lets light through


CHECKER = np.array([[[255, 255, 255, 255], [255, 0, 0, 0]], [[0, 255, 0, 128], [40, 80, 160, 255]]], np.uint8)
MATERIALS = {
    "solid": Material(),
    "glass": Material((0.9, 0.5, 0.1, 1.0), transmission=0.8),
    "red glass": Material((1.0, 0.0, 0.0, 1.0), transmission=1.0),
    "veil": Material((0.5, 0.5, 0.5, 0.3), alpha_mode="BLEND"),
    "air": Material((1.0, 1.0, 1.0, 0.0), alpha_mode="BLEND"),
    "leaf": Material(alpha_mode="MASK", texture=CHECKER),
    "printed": Material((1.0, 0.8, 0.6, 0.9), alpha_mode="BLEND", texture=CHECKER),
    "stained": Material((1.0, 0.9, 0.8, 1.0), transmission=0.7, texture=CHECKER),
    "film": Material(alpha_mode="MASK", transmission=0.5, texture=CHECKER),
}


def arriving(scene, light, samples):
    """The share of light that arrives at each sample, by the definition: every triangle is asked."""
    table, source = transmission_of(scene), light.position.astype(float)
    facing = facing_of_all(scene.positions, scene.triangles, light.position)
    share = np.ones((samples.size, 3))
    flat = samples.take(np.arange(samples.size))
    for s in np.flatnonzero(flat.covered):
        own, side, (u, v) = flat.triangle[s], int(flat.side[s]), flat.barycentric[s].astype(float)
        if side * facing[own] < 0:
            share[s] *= share_at(scene, table, own, (1 - u - v, u, v))
        for t in np.flatnonzero(facing):
            if t == own or table.kind[t] == CLEAR:
                continue
            closed = bool(table.kind[t] == SOLID or table.closed[scene.material_id[t]])
            point = np.empty(3)
            if shadows(scene.positions, scene.triangles, t, facing[t], source, own, u, v, side, point, closed) & 1:
                share[s] *= share_at(scene, table, t, hit_weights(scene.positions, scene.triangles, t, source, point))
    return share.reshape(*samples.shape, 3)


def share_at(scene, table, t, weights):
    if table.kind[t] == SOLID:
        return np.zeros(3)
    if table.kind[t] == EVEN:
        return table.even[table.material_id[t]]
    return np.array(passing(scene.triangles, table, t, *weights)) if table.kind[t] == VARYING else np.ones(3)


def mixed(seed, colors=False, count=36):
    """Triangles at random over a ground, of all kinds of materials."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1, 1, (count, 1, 3)) + rng.normal(0, 0.5, (count, 3, 3))
    ground = np.array([[-4, -2, -4], [4, -2, -4], [4, -2, 4], [-4, -2, 4]])
    positions = np.concatenate([corners.reshape(-1, 3), ground]).astype(np.float32)
    triangles = np.concatenate([np.arange(3 * count).reshape(-1, 3), 3 * count + np.array([[0, 2, 1], [0, 3, 2]])])
    return Scene(
        positions,
        triangles,
        list(MATERIALS.values()),
        np.append(rng.integers(0, len(MATERIALS), count), [0, 0]),
        uv=rng.uniform(-1, 2, (len(positions), 2)),
        colors=rng.uniform(0, 1, (len(positions), 4)) if colors else None,
    )


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("colors", [False, True])
@pytest.mark.parametrize("skip_full", [False, True])
def test_shares_of_light_are_those_of_the_definition(seed, colors, skip_full):
    scene = mixed(seed, colors)
    camera = Camera.look_at((2, 4, 5), (0, -1, 0), fov_y=60, width=44, height=30)
    samples = sample(scene, camera)
    for light in (Light.point((1, 5, 2)), Light.directional((0.2, -1, 0.1)), Light.point((0.1, 0.2, 0.0))):
        mask = prepared(scene, skip_full=skip_full).shadow(light, samples)
        truth = arriving(scene, light, samples)
        assert mask.partial.dtype == np.float32 and mask.tolerance <= 1e-4
        np.testing.assert_allclose(mask.partial, truth, rtol=0, atol=mask.tolerance)
        np.testing.assert_array_equal(mask.in_shadow, (truth == 0).all(axis=-1))
        assert (mask.partial[~samples.covered] == 1).all()
    lit = truth[samples.covered]
    assert ((lit > 0.01) & (lit < 0.99)).any() and (lit == 0).any()


def test_panes_count_once_along_their_edges(opengl):
    # A grid of quads of glass over a ground of quads, the light above: samples on the edges of both, to the last bit.
    steps = np.arange(-2, 3, dtype=np.float32)
    x, z = np.meshgrid(steps, steps, indexing="ij")
    grid = np.stack([x, np.full_like(x, 1.0), z], axis=-1).reshape(-1, 3)
    at = np.arange(25).reshape(5, 5)
    a, b, c, d = at[:-1, :-1].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel(), at[:-1, 1:].ravel()
    pane = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)[:, ::-1]])
    ground = np.array([[-8, 0, -8], [8, 0, -8], [0, 0, 8]], np.float32)
    for material, through in (
        (MATERIALS["glass"], (0.72, 0.4, 0.08)),
        (MATERIALS["red glass"], (1.0, 0.0, 0.0)),
        (Material(alpha_mode="BLEND", base_color=(1, 1, 1, 0.5)), (0.5, 0.5, 0.5)),
    ):
        scene = Scene(
            np.concatenate([grid, ground]), np.concatenate([pane, [[25, 27, 26]]]), [material, Material()],
            [0] * len(pane) + [1],
        )  # fmt: skip
        # On the ground, at multiples of 1 / 8: barycentrics that are whole multiples of 2^-7.
        u, v = np.meshgrid(np.arange(40, 60) / 128, np.arange(40, 60) / 128)
        samples = ViewSamples.on_surface(scene, np.full(u.shape, len(pane)), np.stack([u, v], -1), 1)
        camera = Camera.look_at((0, 30, 0.1), (0, 0, 0), fov_y=40, width=20, height=20)
        depth = np.full(u.shape, 30, np.float32)
        samples = dataclasses.replace(samples, camera=camera, depth=depth)
        light = Light.directional((0, -1, 0))
        mask = prepared(scene).shadow(light, samples)
        truth = arriving(scene, light, samples)
        np.testing.assert_allclose(mask.partial, truth, rtol=0, atol=1e-6)
        below = (np.abs(samples.position[..., [0, 2]]) < 2).all(axis=-1)
        assert below.sum() > 50
        np.testing.assert_allclose(mask.partial[below], np.broadcast_to(through, (below.sum(), 3)), rtol=0, atol=1e-6)
        assert mask.stats["predicate_fallbacks"] > 10


def test_shares_do_not_depend_on_bands_batches_or_room(monkeypatch):
    scene, light = mixed(1, count=60), Light.point((1, 5, 2))
    samples = sample(scene, Camera.look_at((2, 4, 5), (0, -1, 0), fov_y=60, width=300, height=150))
    whole = prepared(scene).shadow(light, samples)
    monkeypatch.setattr(uploaded, "BLOCK", 9000)
    monkeypatch.setattr(frames, "BATCH", 7)
    monkeypatch.setattr(frames, "ROOM", 2)
    parts = prepared(scene).shadow(light, samples)
    np.testing.assert_array_equal(parts.partial, whole.partial)
    np.testing.assert_array_equal(parts.in_shadow, whole.in_shadow)


def test_a_thousand_veils_are_a_product():
    # More than float32's or a sum's range: 1000 layers of 1 %, then of 50 %.
    count = 1000
    corners = np.array([[-3, 0, -3], [3, 0, -3], [0, 0, 5]], np.float32)
    heights = np.concatenate([[0.0], 1.0 + np.arange(count) / count]).astype(np.float32)
    positions = (corners + heights[:, None, None] * np.array([0, 1, 0], np.float32)).reshape(-1, 3)
    triangles = np.arange(len(positions)).reshape(-1, 3)[:, ::-1]
    ground = Scene(positions[:3], triangles[:1] % 3)
    samples = sample(ground, Camera.look_at((0, 0.5, -2), (0, 0, 0.5), width=30, height=20))
    for alpha in (0.01, 0.5):
        veil = Material((1, 1, 1, alpha), alpha_mode="BLEND")
        scene = Scene(positions, triangles, [Material(), veil], [0] + [1] * count)
        mask = prepared(scene).shadow(Light.directional((0, -1, 0)), samples)
        found = mask.partial[samples.covered]
        np.testing.assert_allclose(found, np.full(found.shape, (1 - alpha) ** count), rtol=0, atol=1e-5)
        assert not mask.in_shadow.any(), "hardly anything is not nothing"


def test_what_is_surely_inside_a_textured_caster_is_not_tested():
    corners = np.array([[-30, 0, -30], [30, 0, -30], [0, 0, 60]], np.float32)
    ground = Scene(corners, [[0, 2, 1]])
    samples = sample(ground, Camera.look_at((0, 4, -5), (0, 0, 0), width=300, height=150))
    scene = Scene(
        np.concatenate([corners, corners * 3 + np.array([0, 9, 0])]),
        [[0, 2, 1], [3, 5, 4]],
        [MATERIALS["solid"], MATERIALS["printed"]],
        [0, 1],
        uv=np.arange(12).reshape(6, 2) / 4,
    )
    mask = prepared(scene).shadow(Light.point((1, 50, 2)), samples)
    assert mask.stats["fallbacks"] == samples.covered.sum()
    assert mask.stats["sample_frustum_tests"] < samples.covered.sum() // 4
    few = np.random.default_rng(0).choice(np.flatnonzero(samples.covered), 300, replace=False)
    truth = arriving(scene, Light.point((1, 50, 2)), samples.take(few))
    np.testing.assert_allclose(mask.partial.reshape(-1, 3)[few], truth, rtol=0, atol=1e-5)


def test_equal_triangles_are_one_surface_without_exact_arithmetic(spheres):
    twice = Scene(spheres.positions, np.concatenate([spheres.triangles, spheres.triangles[:, [1, 0, 2]]]))
    samples = picture_of(twice, 60, 40)
    mask = same_as_the_cpu(twice, light_over(twice), samples)
    assert mask.stats["fallbacks"] > 100 and mask.stats["predicate_fallbacks"] == 0
