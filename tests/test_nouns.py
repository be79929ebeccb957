"""Scene, Light, Camera, ViewSamples, ShadowMask, Image, Material: what they hold and what they refuse."""

import io
import warnings
from fractions import Fraction

import numpy as np
import pytest
import trimesh
from PIL import Image as PillowImage

import umbrae as um
from umbrae.formats.resources import decode_texture

TRIANGLE = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def test_scene_holds_float32_and_int32_copies_that_cannot_be_written():
    positions, triangles = np.array(TRIANGLE, float), np.array([[0, 1, 2]])
    scene = um.Scene(positions, triangles)
    positions[0] = 9
    assert scene.positions.dtype == np.float32
    assert scene.triangles.dtype == np.int32
    assert scene.positions.tolist() == TRIANGLE
    with pytest.raises(ValueError, match="read-only"):
        scene.positions[0] = 1
    assert scene.bounds.tolist() == [[0, 0, 0], [1, 1, 0]]
    assert scene.origin.dtype == np.float64


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"positions": [[0, 0], [1, 1]]}, r"positions: wanted \(n, 3\)"),
        ({"positions": [[0, 0, np.nan], [1, 0, 0], [0, 1, 0]]}, "row 0 is .*nan.* wanted finite"),
        ({"positions": [[0, 0, np.inf], [1, 0, 0], [0, 1, 0]]}, "finite"),
        ({"positions": [[0, 0, 1e19], [1, 0, 0], [0, 1, 0]]}, "magnitudes up to 1e18, got 1e"),
        ({"triangles": [[0, 1, 3]]}, r"triangle 0 has indices \[0, 1, 3\], wanted 0 to 2"),
        ({"triangles": [[0, 1, -1]]}, "wanted 0 to 2"),
        ({"triangles": [[0, 1]]}, r"triangles: wanted \(t, 3\)"),
        ({"triangles": [[0.5, 1, 2]]}, "integers"),
        ({"material_id": [1]}, "material_id: wanted 0 to 0"),
        ({"material_id": [0, 0]}, r"material_id: wanted \(1,\)"),
        ({"normals": [[0, 0, 1]]}, "normals: wanted 3 rows"),
        ({"uv": [[0, 0, 1]] * 3}, r"uv: wanted \(n, 2\)"),
        ({"positions": [[0, 0, 0], [1, 0], [0, 1, 0]]}, "positions: .* different lengths"),
        ({"positions": np.array(TRIANGLE, complex)}, "complex128"),
        ({"material_id": [2**32]}, "int32"),
        ({"colors": [[0, 0, 0, 255]] * 3}, r"colors: wanted numbers in \[0, 1\], got 0 to 255"),
        ({"origin": [0, 0]}, "origin: wanted 3"),
    ],
)
def test_scene_refuses(arguments, message):
    with pytest.raises(um.InputError, match=message):
        um.Scene(**{"positions": TRIANGLE, "triangles": [[0, 1, 2]], **arguments})


def test_scene_far_from_zero_is_recentred_in_float64_and_says_so():
    far = np.array([470000.0, 5350000.0, 260.0])
    offsets = np.array([[0.0, 0.0, 0.0], [1.1, 0.0, 0.0], [0.0, 1.3, 0.0]])
    with pytest.warns(um.RecentredWarning, match="Scene.origin"):
        scene = um.Scene(far + offsets, [[0, 1, 2]])
    np.testing.assert_allclose(scene.positions + scene.origin - far, offsets, atol=1e-7)
    np.testing.assert_allclose(scene.local(far + offsets), scene.positions, atol=1e-7)


def test_scene_is_not_moved_where_nothing_would_be_lost():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        um.Scene(np.array(TRIANGLE, np.float32) + np.float32(1e6), [[0, 1, 2]])
        um.Scene(np.array(TRIANGLE, float) + 1e6, [[0, 1, 2]])
        um.Scene(np.array(TRIANGLE) * 0.1 + 1.0, [[0, 1, 2]])


def test_light_is_homogeneous_float32():
    assert um.Light.point((4, 8, -3)).position.tolist() == [4, 8, -3, 1]
    assert um.Light.directional((0, -2, 1)).position.tolist() == [0, 2, -1, 0]
    assert um.Light.point((0.1, 0, 0)).position[0] == np.float32(0.1)


@pytest.mark.parametrize(
    ("azimuth", "elevation", "up", "expected"),
    [
        (0, 0, (0, 1, 0), (0, 0, -1)), (90, 0, (0, 1, 0), (1, 0, 0)), (180, 0, (0, 1, 0), (0, 0, 1)),
        (0, 90, (0, 1, 0), (0, 1, 0)), (0, 0, (0, 0, 1), (0, 1, 0)), (90, 0, (0, 0, 1), (1, 0, 0)),
        (270, 30, (0, 0, 1), (-np.sqrt(3) / 2, 0, 0.5)),
    ],
)  # fmt: skip
def test_sun_turns_clockwise_from_north(azimuth, elevation, up, expected):
    light = um.Light.sun(azimuth, elevation, up=up)
    np.testing.assert_allclose(light.position, [*expected, 0], atol=1e-7)
    assert light.is_directional


def test_sun_at_quarter_turns_is_exact():
    """Else a sun in the zenith would graze walls from one side by 6e-17, and decide what exact methods say of them."""
    assert um.Light.sun(0, 90).position.tolist() == [0, 1, 0, 0]
    assert um.Light.sun(77, -90).position.tolist() == [0, -1, 0, 0]
    for azimuth, level in ((90, (1, 0)), (180, (0, 1)), (-90, (-1, 0)), (450, (1, 0)), (720, (0, -1))):
        assert um.Light.sun(azimuth, 0).position.tolist() == [level[0], 0, level[1], 0]


def test_lights_with_a_size():
    sphere, sun = um.Light.point((0, 1, 0), radius=0.5), um.Light.sun(120, 40, angular_diameter=0.53)
    assert (sphere.radius, sphere.angular_diameter, sphere.is_area) == (0.5, 0.0, True)
    assert (sun.radius, sun.angular_diameter, sun.is_area) == (0.0, 0.53, True)
    assert um.Light.directional((0, -1, 0), angular_diameter=10).is_area
    for hard in (um.Light.point((0, 1, 0)), um.Light.sun(120, 40), um.Light.directional((0, -1, 0))):
        assert not hard.is_area
    np.testing.assert_array_equal(sun.position, um.Light.sun(120, 40).position)


def test_camera_takes_numpy_numbers():
    camera = um.Camera.look_at((0, 0, 5), (0, 0, 0), fov_y=np.float32(50), width=np.int64(20), up=(0, 1e-200, 0))
    assert (camera.fov_y, camera.width, camera.axes[1].tolist()) == (50.0, 20, [0, 1, 0])


def test_sun_with_its_own_north():
    light = um.Light.sun(90, 0, up=(1, 0, 0), north=(0, 1, 0.0))
    np.testing.assert_allclose(light.position[:3], np.cross((0, 1, 0), (1, 0, 0)), atol=1e-7)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: um.Light.directional((0, 0, 0)), "direction that is not zero"),
        (lambda: um.Light.directional((0, 0, 1e-60)), "direction that is not zero"),
        (lambda: um.Light.point((0, np.nan, 0)), "finite"),
        (lambda: um.Light.point((0, 0)), "3 finite numbers"),
        (lambda: um.Light.point("0,0,0"), "3 finite numbers"),
        (lambda: um.Light.point((0, 1e300, 0)), "up to 1e18"),
        (lambda: um.Light.point((0, 0, 0), color="red"), "color: wanted 3"),
        (lambda: um.Light.sun("south", 10), "azimuth: wanted a finite number, got 'south'"),
        (lambda: um.Light.sun(0, None), "elevation: wanted a finite number, got None"),
        (lambda: um.Light.sun(0, 10, up=(1, 1, 1), north=(3, 3, 3)), "parallel"),
        (lambda: um.Light(np.array([0, 0, 1, 0.5])), "w = 0 or w = 1"),
        (lambda: um.Light.sun(0, 91), "-90 to 90"),
        (lambda: um.Light.sun(float("nan"), 10), "azimuth"),
        (lambda: um.Light.sun(0, 10, up=(1, 0, 0)), "north is needed"),
        (lambda: um.Light.sun(0, 10, north=(0, 3, 0)), "parallel"),
        (lambda: um.Light.point((0, 0, 0), intensity=-1), "intensity"),
        (lambda: um.Light.point((0, 0, 0), radius=-1), "radius: wanted a number from 0 to 1e18, got -1"),
        (lambda: um.Light.point((0, 0, 0), radius=np.inf), "radius: wanted a finite number"),
        (lambda: um.Light.point((0, 0, 0), radius=2e18), "radius: wanted a number from 0 to 1e18"),
        (lambda: um.Light.sun(0, 10, angular_diameter=180), "angular_diameter: wanted at least 0 and less than 180"),
        (lambda: um.Light.sun(0, 10, angular_diameter=-0.1), "angular_diameter: wanted at least 0"),
        (lambda: um.Light.directional((0, -1, 0), angular_diameter="wide"), "angular_diameter: wanted a finite"),
        (lambda: um.Light(np.array([0, 0, 1, 0]), radius=1), "a directional light has none; its size is its angular"),
        (lambda: um.Light(np.array([0, 0, 1, 1]), angular_diameter=1), "a point light has none; its size is its radi"),
    ],
)
def test_light_refuses(make, message):
    with pytest.raises(um.InputError, match=message):
        make()


def test_camera_maps_its_target_to_the_centre_and_right_to_right():
    camera = um.Camera.look_at((0, 0, 5), (0, 0, 0), fov_y=90, width=200, height=100)
    x, y, w = camera.world_to_clip @ [0, 0, 0, 1]
    assert (x, y, w) == (0, 0, 5)
    x, y, w = camera.world_to_clip @ [10, 5, 0, 1]
    np.testing.assert_allclose([x / w, y / w], [1, 1])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"target": (0, 0, 5)}, "eye and target are the same"),
        ({"width": 0}, "width: wanted 1 to"),
        ({"height": 10**6}, "height: wanted 1 to"),
        ({"fov_y": 180}, "fov_y"),
        ({"up": (0, 0, 0)}, "up"),
        ({"near": 0.0}, "near"),
        ({"eye": (0, 0, np.inf)}, "finite"),
        ({"eye": "here"}, "eye: wanted 3"),
        ({"fov_y": "wide"}, "fov_y: wanted a finite number"),
        ({"width": 10.5}, "width: wanted a whole number"),
    ],
)
def test_camera_refuses(arguments, message):
    with pytest.raises(um.InputError, match=message):
        um.Camera.look_at(**{"eye": (0, 0, 5), "target": (0, 0, 0), **arguments})


@pytest.mark.parametrize("up", [(0, 1, 0), (0, 0, 1)])
def test_frame_sees_the_whole_scene_and_fills_the_picture(up):
    rng = np.random.default_rng(0)
    scene = um.Scene(rng.uniform(-1, 1, (300, 3)) * [3, 1, 2] + [50, 0, 0], np.arange(300).reshape(-1, 3))
    camera = um.Camera.frame(scene, up=up, width=300, height=200)
    clip = np.concatenate([scene.positions, np.ones((300, 1))], axis=1) @ camera.world_to_clip.T
    on_screen = np.abs(clip[:, :2] / clip[:, 2:])
    assert (clip[:, 2] > camera.near).all()
    assert 0.75 < on_screen.max() <= 1.0


def test_view_samples_on_surface_and_free():
    scene = um.Scene(TRIANGLE, [[0, 1, 2]])
    sensors = um.ViewSamples.on_surface(scene, [0, 0], [[0.25, 0.5], [0, 0]], [1, -1])
    assert sensors.position.tolist() == [[0.25, 0.5, 0], [0, 0, 0]]
    assert sensors.side.tolist() == [1, -1]
    free = um.ViewSamples.points(np.zeros((4, 5, 3)))
    assert free.shape == (4, 5)
    assert (free.triangle == -1).all()
    assert free.covered.all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda s: um.ViewSamples.on_surface(s, [1], [[0, 0]]), "wanted triangles 0 to 0"),
        (lambda s: um.ViewSamples.on_surface(s, [0], [[0.5, np.nextafter(np.float32(0.5), 1)]]), r"u \+ v <= 1"),
        (lambda s: um.ViewSamples.on_surface(s, [0], [[1.0, 1e-15]]), r"u \+ v <= 1"),
        (lambda s: um.ViewSamples.on_surface(s, [0], [[-1e-30, 0]]), "u, v >= 0"),
        (lambda s: um.ViewSamples.on_surface(s, [0], [[np.nan, 0]]), "u, v >= 0"),
        (lambda s: um.ViewSamples.on_surface(s, [0, 0], [[0, 0]]), "barycentrics"),
        (lambda s: um.ViewSamples.on_surface(s, [0], [[0, 0]], 2), r"sides of \+1"),
        (lambda s: um.ViewSamples.points([1, 2]), r"\(\.\.\., 3\)"),
        (lambda s: um.ViewSamples.points([[1, 2, np.nan]]), "finite"),
    ],
)
def test_view_samples_refuse(make, message):
    with pytest.raises(um.InputError, match=message):
        make(um.Scene(TRIANGLE, [[0, 1, 2]]))


@pytest.mark.parametrize(("u", "v"), [(1 / 3, 2 / 3), (0.1, 0.9), (0.7, 0.3), (1.0, 1e-30), (1 - 1e-9, 1e-9)])
def test_barycentrics_on_an_edge_are_rounded_to_the_inside(u, v):
    scene = um.Scene(TRIANGLE, [[0, 1, 2]])
    stored = um.ViewSamples.on_surface(scene, [0, 0], [(u, v), (v, u)]).barycentric
    for pair in stored.tolist():
        assert sum(map(Fraction, pair)) <= 1
    np.testing.assert_allclose(stored, [(u, v), (v, u)], atol=2.0**-23)


@pytest.mark.parametrize("method", [name for name, method in um.METHODS.items() if "points" in method.accepts])
def test_samples_of_another_scene_are_refused(method):
    here = um.Scene(TRIANGLE, [[0, 1, 2]])
    moved = um.Scene(np.array(TRIANGLE) + 1.0, [[0, 1, 2], [0, 2, 1]])
    light = um.Light.point((0, 5, 0))
    beyond = um.ViewSamples.on_surface(moved, [1], [(0.25, 0.25)])
    elsewhere = um.ViewSamples.on_surface(moved, [0], [(0.25, 0.25)])
    for samples, message in ((beyond, "triangles 1 to 1, this has 1"), (elsewhere, "do not lie on")):
        with pytest.raises(um.InputError, match=message):
            um.shadow(here, light, samples, method=method)
        with pytest.raises(um.InputError, match=message):
            um.verify(here, light, samples, um.ShadowMask(np.zeros(1, bool), um.Guarantee.EXACT))


def test_one_thing_in_place_of_another_is_named():
    scene, light, samples = (
        um.Scene(TRIANGLE, [[0, 1, 2]]),
        um.Light.point((0, 5, 0)),
        um.ViewSamples.points([[0, 0, 0]]),
    )
    for make, message in (
        (lambda: um.shadow(scene, (0, 5, 0), samples), "light: wanted Light, got tuple"),
        (lambda: um.shadow("model.glb", light, samples), "scene: wanted Scene, got str"),
        (lambda: um.shadow(scene, light, [[0, 0, 0]]), "samples: wanted ViewSamples, got list"),
        (lambda: um.shadow(scene, light, samples, method=None), "wanted a name or a Method object, got None"),
        (lambda: um.verify(scene, light, samples, np.zeros(1, bool)), "mask: wanted ShadowMask"),
        (lambda: um.sample(scene, None), "camera: wanted Camera, got NoneType"),
        (lambda: um.render(scene, (0, 0, 5)), "camera: wanted Camera, got tuple"),
        (lambda: um.render(scene, lights=(0, 5, 0)), "lights: wanted Light, got int"),
        (lambda: um.Camera.frame("model.glb"), "scene: wanted Scene"),
        (lambda: um.Scene(TRIANGLE, [[0, 1, 2]], materials=["red"]), "materials: wanted Material, got str"),
        (lambda: um.load(None), "wanted a path, got None"),
        (lambda: um.save("model.glb", scene), "save: scene: wanted Scene"),
    ):
        with pytest.raises(um.InputError, match=message):
            make()


def test_material_takes_pillow_images_and_refuses_nonsense():
    picture = PillowImage.new("RGB", (3, 2), (255, 0, 0))
    assert um.Material(texture=picture).texture.shape == (2, 3, 4)
    for arguments in (
        {"base_color": (2, 0, 0, 1)},
        {"alpha_mode": "GLASS"},
        {"transmission": -0.1},
        {"texture": [[0.5]]},
    ):
        with pytest.raises(um.InputError, match="Material"):
            um.Material(**arguments)


@pytest.mark.parametrize("order", ["<u2", ">u2"])
def test_pictures_of_16_bits_are_scaled(order):
    values = np.array([[0, 128, 129, 32767, 32768, 65535]], order)
    picture = PillowImage.fromarray(values)
    assert picture.mode.startswith("I;16")
    expected = np.array([[0, 0, 1, 127, 128, 255]])  # 255 v / 65535, to the nearest
    for texture in (um.Material(texture=picture).texture, decode_texture(in_a_file(picture, "TIFF"), "a.tif")):
        np.testing.assert_array_equal(texture[..., :3], expected[..., None] * np.ones(3))
        assert (texture[..., 3] == 255).all()
    mesh = trimesh.Trimesh(TRIANGLE, [[0, 1, 2]], process=False)
    mesh.visual = trimesh.visual.TextureVisuals(np.zeros((3, 2)), image=picture)
    np.testing.assert_array_equal(um.Scene.from_trimesh(mesh).materials[0].texture[..., 0], expected)


@pytest.mark.parametrize(
    ("values", "kind"),
    [(np.ones((1, 2), np.float32), "floating-point numbers"), (np.ones((1, 2), np.int32), "32-bit integers")],
)
def test_pictures_that_would_be_clipped_are_refused(values, kind):
    picture = PillowImage.fromarray(values)
    with pytest.raises(
        um.InputError, match=f"^Material.texture: wanted a picture of 8 or 16 bits per channel, got {kind}$"
    ):
        um.Material(texture=picture)
    with pytest.raises(
        um.InputError, match=f"^texture a.tif: wanted a picture of 8 or 16 bits per channel, got {kind}$"
    ):
        decode_texture(in_a_file(picture, "TIFF"), "a.tif")
    mesh = trimesh.Trimesh(TRIANGLE, [[0, 1, 2]], process=False)
    mesh.visual = trimesh.visual.TextureVisuals(np.zeros((3, 2)), image=picture)
    with pytest.raises(um.InputError, match=f"^Scene.from_trimesh: the mesh's texture: wanted .* got {kind}$"):
        um.Scene.from_trimesh(mesh)


def in_a_file(picture, kind):
    """The bytes of a picture in a file."""
    file = io.BytesIO()
    picture.save(file, kind)
    return file.getvalue()


def test_truth_values_are_no_whole_numbers():
    scene = um.Scene(TRIANGLE, [[0, 1, 2]])
    camera, points = um.Camera.frame(scene, width=8, height=8), um.ViewSamples.points([[0, 0, 0]])
    mask = um.shadow(scene, um.Light.point((0, 1, 0)), points)
    for make in (
        lambda: um.METHODS["frustum"](seed=True),
        lambda: um.METHODS["frustum"](light_samples=True),
        lambda: um.sample_layers(scene, camera, True),
        lambda: um.sample(scene, camera, True),
        lambda: um.sample_stochastic(scene, camera, 4, seed=True),
        lambda: um.render(scene, camera, layers=True),
        lambda: um.verify(scene, um.Light.point((0, 1, 0)), points, mask, seed=False),
        lambda: um.Camera.look_at((0, 0, 1), (0, 0, 0), width=True),
    ):
        with pytest.raises(um.InputError, match=r"wanted a whole number.* got (True|False)"):
            make()


def test_unknown_method_names_the_known_ones_and_the_nearest():
    scene = um.Scene(TRIANGLE, [[0, 1, 2]])
    with pytest.raises(
        um.OptionError, match=r"unknown method 'frustrum'; did you mean 'frustum'\? \(known: oracle, frustum"
    ):
        um.shadow(scene, um.Light.point((0, 1, 0)), um.ViewSamples.points([[0, 0, 0]]), method="frustrum")


def test_transmittance_is_one_where_lit_and_zero_in_shadow():
    mask = um.ShadowMask(np.array([True, False]), um.Guarantee.EXACT)
    assert mask.transmittance.tolist() == [[0, 0, 0], [1, 1, 1]]
    assert mask.transmittance.dtype == np.float32


def test_image_shows_itself_in_a_notebook():
    assert um.Image(np.zeros((2, 3, 3), np.uint8))._repr_png_().startswith(b"\x89PNG")
