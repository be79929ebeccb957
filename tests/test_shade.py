"""The picture: tone, colour, texture and normals, with answers from pencil and paper."""

import numpy as np
import pytest

from umbrae.camera import Camera
from umbrae.errors import InputError
from umbrae.geometry import diffuse
from umbrae.geometry.glass import mirrored
from umbrae.geometry.mipmap import LINEAR_TO_SRGB, mip_levels
from umbrae.geometry.normals import first_alike, terminator_fade
from umbrae.geometry.texture import SRGB_TO_LINEAR
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask
from umbrae.material import Material
from umbrae.samples import ViewSamples
from umbrae.sampling import sample, sample_layers, sample_stochastic
from umbrae.scene import Scene
from umbrae.shade import mask_image, shade

WHITE = Material((1.0, 1.0, 1.0, 1.0))
FRONT = Camera.look_at((0, 0, 3), (0, 0, 0), width=81, height=81, fov_y=30)
HEAD_ON = Light.directional((0, 0, -1))


def quad(**parts):
    """Two triangles from (-1, -1, 0) to (1, 1, 0), seen from +z; uv (0, 0) at the upper left."""
    positions = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    uv = [(0, 1), (1, 1), (1, 0), (0, 0)]
    return Scene(positions, [(0, 1, 2), (0, 2, 3)], uv=uv, **parts)


def uv_sphere(segments=24, rings=21):
    """960 triangles around the origin, radius 1, wound outwards."""
    heights = np.pi * np.arange(1, rings) / rings
    turns = 2 * np.pi * np.arange(segments) / segments
    ring = [(np.sin(h) * np.cos(t), np.cos(h), -np.sin(h) * np.sin(t)) for h in heights for t in turns]
    positions = np.array([(0, 1, 0), *ring, (0, -1, 0)])
    at = np.arange(len(ring)).reshape(rings - 1, segments) + 1
    after = np.roll(at, -1, axis=1)
    caps = [np.stack([np.zeros_like(at[0]), at[0], after[0]], 1)]
    caps += [np.stack([np.full_like(at[0], len(ring) + 1), after[-1], at[-1]], 1)]
    walls = [np.stack([at[:-1], at[1:], after[1:]], -1), np.stack([at[:-1], after[1:], after[:-1]], -1)]
    return positions, np.concatenate(caps + [wall.reshape(-1, 3) for wall in walls])


def facets(scene):
    a, b, c = np.moveaxis(scene.positions.astype(np.float64)[scene.triangles], 1, 0)
    return np.cross(b - a, c - a)


def convex_mask(scene, light, samples):
    """On a closed convex mesh wound outwards, just the facets that face away are dark."""
    away = facets(scene) @ light.position[:3].astype(np.float64) < 0
    return mask_of(away[samples.triangle] & samples.covered)


def mask_of(dark):
    return ShadowMask(np.asarray(dark, bool), Guarantee.EXACT)


def lit(samples):
    return mask_of(np.zeros(samples.shape))


def dark(samples):
    return mask_of(np.ones(samples.shape))


def shoulder(linear):
    excess = (linear - diffuse.SHOULDER) / (1 - diffuse.SHOULDER)
    return np.where(
        linear <= diffuse.SHOULDER, linear, diffuse.SHOULDER + (1 - diffuse.SHOULDER) * excess / (1 + excess)
    )


def code(linear):
    """sRGB code of tone-mapped light, by the formula of IEC 61966-2-1."""
    linear = np.asarray(linear, float)
    return 255 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def wall_ambient():
    """An upright wall sees half sky, half ground."""
    return (np.array(diffuse.SKY_LIGHT) + np.array(diffuse.GROUND_LIGHT)) / 2


@pytest.fixture(scope="module")
def ball():
    """A coarse sphere with smooth normals, a light from the right, and what is seen."""
    positions, triangles = uv_sphere()
    scene = Scene(positions, triangles, normals=positions, materials=[WHITE])
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), width=301, height=301, fov_y=32)
    light = Light.directional((-1, -0.3, -0.2))
    samples = sample(scene, camera)
    return scene, camera, light, samples, convex_mask(scene, light, samples)


def test_srgb_transfer_has_the_known_codes():
    for linear, expected in [(0.0, 0), (1.0, 255), (0.5, 188), (0.18, 118), (0.0031308, 10), (0.001, 3)]:
        assert LINEAR_TO_SRGB[round(linear * 65535)] == expected
    back = LINEAR_TO_SRGB[np.round(SRGB_TO_LINEAR.astype(float) * 65535).astype(int)]
    np.testing.assert_array_equal(back, np.arange(256))


def test_white_wall_in_full_light():
    samples = sample(quad(materials=[WHITE]), FRONT)
    pixels = shade(quad(materials=[WHITE]), FRONT, [HEAD_ON], samples, [lit(samples)])
    expected = code(shoulder(diffuse.DIRECT + wall_ambient()))
    np.testing.assert_allclose(pixels[40, 40], expected, atol=0.51)
    assert pixels[40, 40].max() < 250, "light surfaces in full sun do not clip"


def test_in_shadow_only_ambient_light_is_left():
    material = Material((0.5, 0.25, 0.125, 1.0))
    samples = sample(quad(materials=[material]), FRONT)
    pixels = shade(quad(materials=[material]), FRONT, [HEAD_ON], samples, [dark(samples)])
    np.testing.assert_allclose(pixels[40, 40], code(np.array([0.5, 0.25, 0.125]) * wall_ambient()), atol=0.51)


@pytest.mark.parametrize("size", [2.0**-50, 2.0**-12, 2.0**25, 2.0**55])
def test_the_unit_of_length_does_not_matter(size):
    scene = quad(materials=[WHITE])
    resized = Scene(np.float32(size) * scene.positions, scene.triangles, scene.materials)
    camera = Camera.look_at((0, 0, 3 * size), (0, 0, 0), width=81, height=81, fov_y=30, near=size)
    samples = sample(resized, camera)
    pixels = shade(resized, camera, [HEAD_ON], samples, [lit(samples)])
    np.testing.assert_allclose(pixels[40, 40], code(shoulder(diffuse.DIRECT + wall_ambient())), atol=0.51)


def test_light_at_sixty_degrees_gives_half():
    samples = sample(quad(materials=[WHITE]), FRONT)
    light = Light.directional((np.sqrt(3) / 2, 0, -0.5))
    pixels = shade(quad(materials=[WHITE]), FRONT, [light], samples, [lit(samples)])
    np.testing.assert_allclose(pixels[40, 40], code(shoulder(diffuse.DIRECT / 2 + wall_ambient())), atol=0.51)


def test_point_light_shines_from_its_place():
    samples = sample(quad(materials=[WHITE]), FRONT)
    pixels = shade(quad(materials=[WHITE]), FRONT, [Light.point((0, 0, 0.5))], samples, [lit(samples)])
    np.testing.assert_allclose(pixels[40, 40], code(shoulder(diffuse.DIRECT + wall_ambient())), atol=0.51)
    assert (pixels[40, 5] < pixels[40, 25]).all() and (pixels[40, 25] < pixels[40, 40]).all()


def test_the_back_of_a_sheet_is_shaded_like_its_front():
    behind = Camera.look_at((0, 0, -3), (0, 0, 0), width=81, height=81, fov_y=30)
    for normals in (None, [(0, 0, 1)] * 4, [(0, 0, -1)] * 4):
        scene = quad(materials=[WHITE], normals=normals)
        samples = sample(scene, behind)
        pixels = shade(scene, behind, [Light.directional((0, 0, 1))], samples, [lit(samples)])
        np.testing.assert_allclose(pixels[40, 40], code(shoulder(diffuse.DIRECT + wall_ambient())), atol=0.51)


def test_several_lights_add_up_and_do_not_blow_out():
    scene = quad(materials=[WHITE])
    samples = sample(scene, FRONT)
    mask = lit(samples)

    def centre(*lights):
        return shade(scene, FRONT, lights, samples, [mask] * len(lights))[40, 40].astype(int)

    def of(color=(1.0, 1.0, 1.0), intensity=1.0):
        return Light(HEAD_ON.position, color, intensity)

    np.testing.assert_array_equal(centre(of(), of()), centre(of()))
    np.testing.assert_array_equal(centre(of(intensity=7.0)), centre(of()))
    np.testing.assert_allclose(
        centre(of(intensity=0.5)), code(shoulder(diffuse.DIRECT / 2 + wall_ambient())), atol=0.51
    )
    np.testing.assert_array_equal(centre(of(intensity=0.25), of(intensity=0.25)), centre(of(intensity=0.5)))
    red = code(shoulder(diffuse.DIRECT * np.array([1, 0, 0]) + wall_ambient()))
    np.testing.assert_allclose(centre(of(color=(1.0, 0.0, 0.0))), red, atol=0.51)
    np.testing.assert_allclose(centre(), code(wall_ambient()), atol=0.51)


def test_each_light_has_its_own_mask():
    scene = quad(materials=[WHITE])
    samples = sample(scene, FRONT)
    lights = [Light(HEAD_ON.position, (1, 0, 0), 0.5), Light(HEAD_ON.position, (0, 0, 1), 0.5)]
    pixels = shade(scene, FRONT, lights, samples, [lit(samples), dark(samples)])
    expected = code(shoulder(diffuse.DIRECT * np.array([0.5, 0, 0]) + wall_ambient()))
    np.testing.assert_allclose(pixels[40, 40], expected, atol=0.51)


def test_samples_of_a_pixel_are_averaged_after_tone_mapping():
    scene = quad(materials=[WHITE])
    camera = Camera.look_at((0, 0, 3), (0, 0, 0), width=1, height=1)
    on = ViewSamples.on_surface(scene, [0, 0], [(0.0, 0.5), (0.0, 0.5)])
    samples = ViewSamples(
        on.triangle.reshape(1, 1, 2),
        on.barycentric.reshape(1, 1, 2, 2),
        on.side.reshape(1, 1, 2),
        on.position.reshape(1, 1, 2, 3),
        on.covered.reshape(1, 1, 2),
    )
    pixels = shade(scene, camera, [HEAD_ON], samples, [mask_of([[[False, True]]])])
    mean = (shoulder(diffuse.DIRECT + wall_ambient()) + wall_ambient()) / 2
    np.testing.assert_allclose(pixels[0, 0], code(mean), atol=0.51)


def test_base_color_vertex_colors_and_texture_multiply():
    material = Material((0.5, 1.0, 1.0, 1.0), texture=np.full((4, 4, 4), (255, 188, 255, 255), np.uint8))
    scene = quad(materials=[material], colors=[(1.0, 1.0, 0.25, 1.0)] * 4)
    samples = sample(scene, FRONT)
    pixels = shade(scene, FRONT, [HEAD_ON], samples, [dark(samples)])
    expected = code(np.array([0.5, SRGB_TO_LINEAR[188], 0.25]) * wall_ambient())
    np.testing.assert_allclose(pixels[40, 40], expected, atol=0.51)


def test_texture_is_the_right_way_up():
    red, green, blue, white = (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)
    scene = quad(materials=[Material((1, 1, 1, 1), texture=np.array([[red, green], [blue, white]], np.uint8))])
    samples = sample(scene, FRONT)
    pixels = shade(scene, FRONT, [HEAD_ON], samples, [lit(samples)])
    rows, columns = np.nonzero(samples.covered)
    near = [int(rows.min() + np.ptp(rows) * share) for share in (0.25, 0.75)]
    across = [int(columns.min() + np.ptp(columns) * share) for share in (0.25, 0.75)]
    bright = [[tuple(pixels[y, x] > 0.75 * pixels[y, x].max()) for x in across] for y in near]
    assert bright == [
        [(True, False, False), (False, True, False)],
        [(False, False, True), (True, True, True)],
    ]


def test_a_fine_texture_far_away_turns_to_its_mean():
    checks = np.where((np.indices((256, 256)).sum(axis=0) % 2)[..., None] == 1, np.uint8(255), np.uint8(0))
    scene = quad(materials=[Material((1, 1, 1, 1), texture=np.repeat(checks, 3, axis=2))])
    for eye in ((0, 0, 9), (0, 8, 2)):
        camera = Camera.look_at(eye, (0, 0, 0), up=(0, 1, 0.1), width=81, height=81, fov_y=20)
        samples = sample(scene, camera)
        grey = quad(materials=[Material((0.5, 0.5, 0.5, 1.0))])
        pixels = shade(scene, camera, [HEAD_ON], samples, [dark(samples)]).astype(int)
        expected = shade(grey, camera, [HEAD_ON], samples, [dark(samples)]).astype(int)
        assert samples.covered.sum() > 200
        assert np.abs(pixels - expected)[samples.covered].max() <= 3


@pytest.mark.parametrize("shape", [(8, 8), (7, 5), (1, 6), (16, 3)])
def test_mip_levels_keep_the_mean_light(shape):
    texture = np.random.default_rng(3).integers(0, 256, (*shape, 4)).astype(np.uint8)
    levels = mip_levels(texture, True)
    assert levels[-1].shape == (1, 1, 4)
    mean = SRGB_TO_LINEAR[texture[..., :3]].mean(axis=(0, 1))
    # Each level rounds to 8 bits.
    np.testing.assert_allclose(SRGB_TO_LINEAR[levels[-1][0, 0, :3]], mean, atol=0.004 * len(levels))
    assert abs(int(levels[-1][0, 0, 3]) - texture[..., 3].mean()) <= 0.5 * len(levels)


def test_what_is_transparent_does_not_bleed_into_a_cutout():
    leaf = np.zeros((8, 8, 4), np.uint8)
    leaf[..., 0] = 255  # red, and invisible
    leaf[2:5, 2:5] = (0, 200, 0, 255)
    levels = mip_levels(leaf, False)
    for level in levels:
        np.testing.assert_array_equal(level[..., :3], np.broadcast_to((0, 200, 0), level[..., :3].shape))
    assert (levels[0][..., 3] == leaf[..., 3]).all() and leaf[0, 0, 0] == 255


def test_brightness_is_continuous_across_the_edges_of_a_coarse_sphere(ball):
    scene, camera, light, samples, mask = ball
    smooth = shade(scene, camera, [light], samples, [mask]).astype(int)
    flat = shade(Scene(scene.positions, scene.triangles, materials=[WHITE]), camera, [light], samples, [mask]).astype(
        int
    )
    # Away from the outline, where surfaces turn away from the eye within few pixels.
    inside = samples.position[..., 2] > 0.3
    steps = [
        np.abs(np.diff(image, axis=1)).max(axis=2)[inside[:, 1:] & inside[:, :-1]].max() for image in (smooth, flat)
    ]
    assert steps[0] <= 8, "smooth normals: no facet edge, no jagged terminator"
    assert steps[1] >= 20, "the same sphere without normals does show its facets"


def test_the_terminator_fades_monotonously_and_ends_where_the_mask_begins(ball):
    scene, camera, light, samples, mask = ball
    level = Light.directional((-1, 0, 0))
    middle = shade(scene, camera, [level], samples, [convex_mask(scene, level, samples)])[150].astype(int)
    shadow = shade(scene, camera, [level], samples, [dark(samples)])[150].astype(int)
    direct = (middle - shadow).sum(axis=1)[samples.covered[150]]
    assert direct[0] == 0 and direct[-1] > 100
    # Rounding to codes may take one step back per channel.
    assert np.diff(direct).min() >= -3
    pixels = shade(scene, camera, [light], samples, [mask])
    ambient = shade(scene, camera, [light], samples, [dark(samples)])
    np.testing.assert_array_equal(pixels[mask.in_shadow], ambient[mask.in_shadow])


def test_fade_is_zero_at_facets_that_face_away_and_one_where_all_is_flat():
    positions, triangles = uv_sphere()
    scene = Scene(positions, triangles, normals=positions)
    light = np.array([[0.3, 0.8, 0.5, 0.0]])
    fade = np.empty((1, len(positions), 2), np.float32)
    terminator_fade(
        scene.positions, scene.triangles, scene.normals, np.arange(len(positions), dtype=np.int32), light, 0, fade
    )
    facing = facets(scene) @ light[0, :3] > 0
    touched = np.zeros((2, len(positions)), bool)
    np.logical_or.at(touched[0], scene.triangles[~facing].reshape(-1), True)
    np.logical_or.at(touched[1], scene.triangles[facing].reshape(-1), True)
    assert (fade[0, touched[0], 0] == 0).all() and (fade[0, touched[1], 1] == 0).all()
    assert (fade[0, ~touched[0], 0] > 0).all() and fade.max() <= 1
    plane = quad(normals=[(0, 0, 1)] * 4)
    fade = np.empty((1, 4, 2), np.float32)
    terminator_fade(plane.positions, plane.triangles, plane.normals, np.arange(4, dtype=np.int32), light, 0, fade)
    np.testing.assert_array_equal(fade[0], [(1, 0)] * 4)


def test_repeated_vertices_fade_like_shared_ones(ball):
    scene, camera, light, samples, mask = ball
    corners = scene.triangles.reshape(-1)
    apart = Scene(
        scene.positions[corners],
        np.arange(len(corners)).reshape(-1, 3),
        normals=scene.normals[corners],
        materials=[WHITE],
    )
    np.testing.assert_array_equal(
        shade(apart, camera, [light], samples, [mask]), shade(scene, camera, [light], samples, [mask])
    )
    first = first_alike(apart.positions, apart.normals)
    expected = {}
    for vertex, key in enumerate(corners):
        assert first[vertex] == expected.setdefault(key, vertex)


def test_a_missing_normal_falls_back_to_the_facet(ball):
    scene, camera, light, samples, mask = ball
    plain = Scene(scene.positions, scene.triangles, materials=[WHITE])
    empty = Scene(scene.positions, scene.triangles, materials=[WHITE], normals=np.zeros_like(scene.positions))
    np.testing.assert_array_equal(
        shade(empty, camera, [light], samples, [mask]), shade(plain, camera, [light], samples, [mask])
    )


def test_normals_against_the_winding_are_turned(ball):
    scene, camera, light, samples, mask = ball
    against = Scene(scene.positions, scene.triangles, materials=[WHITE], normals=-scene.normals)
    difference = shade(against, camera, [light], samples, [mask]).astype(int) - shade(
        scene, camera, [light], samples, [mask]
    )
    assert np.abs(difference).max() <= 1


def test_background_has_a_blue_sky_above_and_ground_below():
    scene = Scene([], [])
    for up, eye in (((0, 1, 0), (0, 0, 3)), ((0, 0, 1), (3, 0, 0))):
        camera = Camera.look_at(eye, (0, 0, 0), up=up, width=31, height=61, fov_y=80)
        samples = sample(scene, camera)
        pixels = shade(scene, camera, [], samples, [], up=up).astype(int)
        assert pixels[0, 15, 2] > pixels[0, 15, 0] + 30
        assert np.ptp(pixels[60, 15]) < 10 and pixels[60, 15].max() < pixels[30, 15].min()
        assert np.abs(np.diff(pixels, axis=0)).max() < 20, "no hard horizon"


def test_the_number_of_threads_changes_nothing(ball, monkeypatch):
    scene, camera, light, samples, mask = ball
    pictures = []
    for threads in ("1", "2", "5"):
        monkeypatch.setenv("UMBRAE_THREADS", threads)
        pictures.append(shade(scene, camera, [light], samples, [mask]))
    assert (pictures[0] == pictures[1]).all() and (pictures[0] == pictures[2]).all()


def test_what_does_not_belong_together_is_refused(ball):
    scene, camera, light, samples, mask = ball
    with pytest.raises(InputError, match="one mask per light, got 2 masks and 1 lights"):
        shade(scene, camera, [light], samples, [mask, mask])
    with pytest.raises(InputError, match=r"mask 0 has shape \(2, 2\)"):
        shade(scene, camera, [light], samples, [mask_of(np.zeros((2, 2)))])
    with pytest.raises(InputError, match=r"samples of the camera's image, \(81, 81\)"):
        shade(scene, FRONT, [light], samples, [mask])
    with pytest.raises(InputError, match="up: wanted 3 finite numbers"):
        shade(scene, camera, [light], samples, [mask], up=(0, 0, 0))
    with pytest.raises(InputError, match="finite"):
        shade(scene, camera, [Light(light.position, (1e300, 1, 1), 1e300)], samples, [mask])


# Shares of light


def shares(shape, share):
    return ShadowMask(np.zeros(shape, bool), Guarantee.EXACT, partial=np.full((*shape, 3), share, np.float32))


def test_light_arrives_by_its_share_in_each_channel():
    scene = quad(materials=[WHITE])
    samples = sample(scene, FRONT)
    share = np.array([0.5, 0.25, 0.0])
    pixels = shade(scene, FRONT, [HEAD_ON], samples, [shares(samples.shape, share)])
    np.testing.assert_allclose(pixels[40, 40], code(shoulder(diffuse.DIRECT * share + wall_ambient())), atol=0.51)
    # Beside a light that arrives or does not, in either order.
    lights = [Light(HEAD_ON.position, (1, 1, 1), 0.5)] * 2
    for masks in ([lit(samples), shares(samples.shape, share)], [shares(samples.shape, share), lit(samples)]):
        pixels = shade(scene, FRONT, lights, samples, masks)
        expected = code(shoulder(diffuse.DIRECT * (0.5 + 0.5 * share) + wall_ambient()))
        np.testing.assert_allclose(pixels[40, 40], expected, atol=0.51)


def test_shares_of_all_and_nothing_are_light_and_shadow(ball):
    scene, camera, light, samples, mask = ball
    one = np.repeat(np.where(mask.in_shadow, np.float32(0), np.float32(1))[..., None], 3, axis=-1)
    whole = ShadowMask(mask.in_shadow, Guarantee.EXACT, partial=one)
    also = ShadowMask(np.zeros_like(mask.in_shadow), Guarantee.EXACT, partial=one)
    expected = shade(scene, camera, [light], samples, [mask])
    for same in (whole, also):
        np.testing.assert_array_equal(shade(scene, camera, [light], samples, [same]), expected)


# Layers


def sheets(*materials, texture_uv=True):
    """Quads behind one another, one unit apart, from (-9, -9, 0) to (9, 9, 0) on; the first is nearest to the eye."""
    corner = np.array([(-9, -9), (9, -9), (9, 9), (-9, 9)], float)
    positions = np.concatenate([np.column_stack([corner, np.full(4, -z)]) for z in range(len(materials))])
    triangles = np.concatenate([np.array([(0, 1, 2), (0, 2, 3)]) + 4 * i for i in range(len(materials))])
    uv = np.tile([(0, 1), (1, 1), (1, 0), (0, 0)], (len(materials), 1))
    return Scene(positions, triangles, materials, np.repeat(np.arange(len(materials)), 2), uv=uv)


def centre(scene, shadows, camera=FRONT, **options):
    """The colour at the picture's centre, where the eye looks squarely at the sheets and level into the distance."""
    layers = sample_layers(scene, camera)
    masks = [[mask(layer)] for layer, mask in zip(layers, shadows, strict=True)]
    return shade(scene, camera, [HEAD_ON], layers, masks, **options)[40, 40]


FRONT_COLOR, BACK_COLOR = np.array([0.2, 0.6, 0.4]), np.array([0.9, 0.5, 0.3])
PANE = Material((*FRONT_COLOR, 0.25), "BLEND")
WALL = Material(tuple(BACK_COLOR))


def test_a_pane_before_a_wall_mixes_by_its_opacity():
    expected = (0.25 * FRONT_COLOR + 0.75 * BACK_COLOR) * wall_ambient()
    np.testing.assert_allclose(centre(sheets(PANE, WALL), [dark, dark]), code(expected), atol=0.51)
    three = (0.25 * FRONT_COLOR * (1 + 0.75) + 0.75**2 * BACK_COLOR) * wall_ambient()
    np.testing.assert_allclose(centre(sheets(PANE, PANE, WALL), [dark, dark, dark]), code(three), atol=0.51)


def test_each_layer_has_its_own_shadow():
    for shadows, (front, back) in (((lit, dark), (1, 0)), ((dark, lit), (0, 1)), ((lit, lit), (1, 1))):
        expected = 0.25 * FRONT_COLOR * (front * diffuse.DIRECT + wall_ambient())
        expected += 0.75 * BACK_COLOR * (back * diffuse.DIRECT + wall_ambient())
        np.testing.assert_allclose(centre(sheets(PANE, WALL), shadows), code(shoulder(expected)), atol=0.51)
    half = [dark, lambda layer: shares(layer.shape, (0.5, 1.0, 0.0))]
    expected = 0.25 * FRONT_COLOR * wall_ambient()
    expected += 0.75 * BACK_COLOR * (diffuse.DIRECT * np.array([0.5, 1.0, 0.0]) + wall_ambient())
    np.testing.assert_allclose(centre(sheets(PANE, WALL), half), code(shoulder(expected)), atol=0.51)


def test_what_passes_all_layers_meets_the_background():
    expected = 0.25 * FRONT_COLOR * wall_ambient() + 0.75 * np.array(diffuse.HORIZON)
    np.testing.assert_allclose(centre(sheets(PANE), [dark]), code(shoulder(expected)), atol=0.51)
    # The same where a later layer is there for other samples only.
    beside = Scene(
        np.concatenate([sheets(PANE).positions, np.array([(0.5, -9, -1), (9, 0, -1), (0.5, 9, -1)])]),
        [(0, 1, 2), (0, 2, 3), (4, 5, 6)],
        [PANE, WALL],
        [0, 0, 1],
        uv=np.zeros((7, 2)),
    )
    np.testing.assert_allclose(centre(beside, [dark, dark]), code(shoulder(expected)), atol=0.51)


def test_glass_tints_what_lies_behind_and_mirrors_the_sky():
    glass = Material(tuple(FRONT_COLOR), transmission=0.8)
    expected = 0.2 * FRONT_COLOR * wall_ambient() + 0.8 * 0.04 * np.array(diffuse.HORIZON)
    expected += 0.8 * 0.96 * FRONT_COLOR * BACK_COLOR * wall_ambient()
    np.testing.assert_allclose(centre(sheets(glass, WALL), [dark, dark]), code(expected), atol=0.51)
    # Opacity counts for all of it: three quarters of the sheet are not there.
    quarter = Material((*FRONT_COLOR, 0.25), "BLEND", transmission=0.8)
    mixed = 0.25 * expected + 0.75 * BACK_COLOR * wall_ambient()
    np.testing.assert_allclose(centre(sheets(quarter, WALL), [dark, dark]), code(mixed), atol=0.51)


def test_glass_mirrors_more_at_grazing_angles():
    assert mirrored.py_func((0.0, 0.0, 1.0), (0.0, 0.0, 1.0)) == pytest.approx(0.04)
    assert mirrored.py_func((0.0, 0.0, -1.0), (0.0, 0.0, 1.0)) == pytest.approx(0.04)
    assert mirrored.py_func((0.0, 0.0, 1.0), (0.6, 0.0, 0.8)) == pytest.approx(0.04 + 0.96 * 0.2**5)
    assert mirrored.py_func((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)) == 1.0


def test_clear_glass_is_seen():
    clear = Material((1, 1, 1), transmission=1.0)
    expected = 0.96 * BACK_COLOR * wall_ambient() + 0.04 * np.array(diffuse.HORIZON)
    np.testing.assert_allclose(centre(sheets(clear, WALL), [dark, dark]), code(expected), atol=0.51)


def test_opacity_is_that_of_texture_and_vertex_colours_right_there():
    texture = np.full((4, 4, 4), 255, np.uint8)
    texture[..., 3] = (0, 64, 128, 255)  # from left to right
    front = sheets(Material((0, 0, 0, 0.8), "BLEND", texture=texture), WALL)
    colors = np.ones((8, 4))
    colors[:4, 3] = 0.5
    scene = Scene(front.positions, front.triangles, front.materials, front.material_id, uv=front.uv, colors=colors)
    for alpha, shown in ((0.8, front), (0.4, scene)):
        expected = (1 - alpha * 96 / 255) * BACK_COLOR * wall_ambient()  # amid the second and the third
        np.testing.assert_allclose(centre(shown, [dark, dark]), code(expected), atol=0.51)


def test_a_mask_is_solid_where_it_is_seen():
    texture = np.full((4, 4, 4), 255, np.uint8)
    texture[..., 3] = 160
    scene = sheets(Material((*FRONT_COLOR, 1.0), "MASK", 0.5, texture=texture), WALL)
    np.testing.assert_allclose(centre(scene, [dark]), code(FRONT_COLOR * wall_ambient()), atol=0.51)


def test_one_layer_alone_is_shown_as_if_solid(ball):
    scene = sheets(PANE, WALL)
    samples = sample(scene, FRONT)
    pixels = shade(scene, FRONT, [HEAD_ON], samples, [dark(samples)])
    np.testing.assert_allclose(pixels[40, 40], code(FRONT_COLOR * wall_ambient()), atol=0.51)
    # Of a solid scene it makes no difference.
    scene, camera, light, samples, mask = ball
    alone, layered = (shade(scene, camera, [light], *these) for these in ((samples, [mask]), ([samples], [[mask]])))
    np.testing.assert_array_equal(alone, layered)


def test_samples_chosen_by_chance_are_averaged_before_tone_mapping():
    camera = Camera.look_at((0, 0, 3), (0, 0, 0), width=1, height=1, fov_y=1)
    scene = sheets(Material((1, 1, 1, 0.5), "BLEND"), Material((0, 0, 0)))
    samples = sample_stochastic(scene, camera, 2)
    assert sorted((samples.triangle // 2).reshape(-1).tolist()) == [0, 1]
    pixels = shade(scene, camera, [HEAD_ON], samples, [lit(samples)])
    np.testing.assert_allclose(pixels[0, 0], code(shoulder((diffuse.DIRECT + wall_ambient()) / 2)), atol=0.51)
    count = np.array([0.5, 0.25, 0.0], np.float32)
    less = ViewSamples(*(getattr(samples, name) for name in ARRAYS), throughput=samples.throughput * count)
    pixels = shade(scene, camera, [HEAD_ON], less, [lit(samples)])
    np.testing.assert_allclose(pixels[0, 0], code(shoulder(count * (diffuse.DIRECT + wall_ambient()) / 2)), atol=0.51)


ARRAYS = ("triangle", "barycentric", "side", "position", "covered", "depth", "camera")


@pytest.mark.parametrize(
    "glass",
    [
        Material((0.3, 0.3, 0.3, 0.4), "BLEND"),
        Material((0.7, 0.7, 0.7), transmission=0.6),
        Material((0.9, 0.4, 0.1, 0.7), "BLEND", transmission=0.9),
    ],
    ids=["blend", "grey", "coloured"],
)
def test_layers_and_chance_agree_on_average(glass):
    """A pane and a ball of glass before a wall, seen aslant; dim, so that tone mapping changes nothing."""
    positions, triangles = uv_sphere(12, 9)
    wall = np.array([(-3, -3, -2), (3, -3, -2), (3, 3, -2), (-3, 3, -2)], float)
    pane = wall * (0.6, 0.6, 0) + (0.5, 0.3, 1.5)
    scene = Scene(
        np.concatenate([positions, wall, pane]),
        np.concatenate([triangles, np.array([(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)]) + len(positions)]),
        [glass, Material((0.4, 0.4, 0.4))],
        [0] * len(triangles) + [1, 1, 0, 0],
        normals=np.concatenate([positions, np.tile((0, 0, 1), (8, 1))]),
    )
    camera = Camera.look_at((1, 1.5, 5), (0, 0, 0), width=48, height=48, fov_y=40)
    layers, chosen = sample_layers(scene, camera), sample_stochastic(scene, camera, 64, seed=4)
    assert len(layers) == 4
    light = Light(HEAD_ON.position, intensity=0.3)

    def mean(samples, masks):
        return SRGB_TO_LINEAR[shade(scene, camera, [light], samples, masks)].astype(float).mean(axis=(0, 1))

    fine = sample_layers(scene, camera, samples_per_pixel=64)
    expected, found = mean(fine, [[lit(layer)] for layer in fine]), mean(chosen, [lit(chosen)])
    solid = mean(ViewSamples(*(getattr(chosen, name) for name in ARRAYS)), [lit(chosen)])
    np.testing.assert_allclose(found, expected, rtol=0.004)
    assert glass.transmission == 0 or (np.abs(solid - expected) > 0.02 * expected).any(), "weights matter"


def test_layers_that_do_not_belong_together_are_refused():
    scene = sheets(PANE, WALL)
    first, second = sample_layers(scene, FRONT)
    mask = dark(first)
    with pytest.raises(InputError, match="2 layers and 1 lists"):
        shade(scene, FRONT, [HEAD_ON], [first, second], [[mask]])
    with pytest.raises(InputError, match="0 layers"):
        shade(scene, FRONT, [HEAD_ON], [], [])
    with pytest.raises(InputError, match="one mask per light, got 2 masks and 1 lights"):
        shade(scene, FRONT, [HEAD_ON], [first, second], [[mask], [mask, mask]])
    with pytest.raises(InputError, match="layers: wanted ViewSamples, got ShadowMask"):
        shade(scene, FRONT, [HEAD_ON], [first, mask], [[mask], [mask]])
    for other in (sample(scene, FRONT, 2), sample_stochastic(scene, FRONT)):
        with pytest.raises(InputError, match="layers of one shape"):
            shade(scene, FRONT, [HEAD_ON], [first, other], [[mask], [mask]])
    short = ShadowMask(mask.in_shadow, Guarantee.EXACT, partial=np.zeros((2, 2, 3), np.float32))
    with pytest.raises(InputError, match="mask 0 has shares of shape"):
        shade(scene, FRONT, [HEAD_ON], first, [short])


def test_mask_image_is_white_where_light_arrives():
    np.testing.assert_array_equal(mask_image(mask_of([[True, False]])), np.array([[0, 255]], np.uint8))
    several = mask_of([[[True, False, False, False], [True, True, True, True]]])
    np.testing.assert_array_equal(mask_image(several), np.array([[191, 0]], np.uint8))
    with pytest.raises(InputError, match="mask of an image"):
        mask_image(mask_of([True, False]))


def test_mask_image_shows_shares_of_light():
    grey = shares((2, 3), 0.2)
    np.testing.assert_array_equal(mask_image(grey), np.full((2, 3), 51, np.uint8))
    np.testing.assert_array_equal(mask_image(shares((1, 2), (1, 0.6, 0))), np.full((1, 2, 3), (255, 153, 0), np.uint8))
    mixed = shares((1, 1, 2), 1.0)
    mixed.partial[0, 0, 1] = (0.0, 0.2, 0.2)
    np.testing.assert_array_equal(mask_image(mixed), [[(128, 153, 153)]])
