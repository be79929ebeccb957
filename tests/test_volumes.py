"""Shadow volumes: closed, whatever the soup; options that change speed only; what is refused."""

import dataclasses

import numpy as np
import pytest

import umbrae as um
from soups import SOUPS
from test_contract import image_samples, lights_of
from umbrae import METHODS, Camera, Light, Scene, ViewSamples, models, sample, verify
from umbrae.errors import InputError, OptionError
from umbrae.mask import Guarantee
from umbrae.methods.volumes.eye import count_at_eye
from umbrae.methods.volumes.method import SilhouetteMethod, VolumeMethod
from umbrae.methods.volumes.view import Rounding

pytestmark = pytest.mark.usefixtures("opengl")
VOLUMES = [name for name, method in METHODS.items() if issubclass(method, VolumeMethod)]
SILHOUETTES = [name for name in VOLUMES if issubclass(METHODS[name], SilhouetteMethod)]
TRICKY = ("cube", "open_box", "open_fan", "edge_of_128", "opposite_windings", "degenerate", "tilted_grid", "needle",
          "interpenetrating", "t_junction_open", "coincident", "camera_in_shadow")  # fmt: skip


def around_eye(scene, light, camera, casting=None):
    triangles = scene.triangles if casting is None else scene.triangles[casting]
    rounding = Rounding.of(scene, camera, subpixel_bits=8)
    return count_at_eye(scene.positions, triangles, light.position, camera.eye, rounding.world)


@pytest.mark.parametrize("method", VOLUMES)
@pytest.mark.parametrize("name", TRICKY)
def test_all_faces_of_closed_volumes_add_up_to_the_number_of_volumes_around_the_eye(method, name):
    soup = SOUPS[name]
    caster = METHODS[method]().prepare(soup.scene)
    low, high = soup.scene.bounds.astype(np.float64)
    inside_of_it = Camera.look_at(low + 0.4 * (high - low) + 0.01, soup.eye, width=40, height=28)
    for camera in (Camera.look_at(soup.eye, soup.target, fov_y=60, width=40, height=28), inside_of_it):
        samples = sample(soup.scene, camera)
        for kind, light in lights_of(soup).items():
            casting = caster.casting(light)
            of = None if casting is None else caster.mesh.source[casting]
            held = around_eye(soup.scene, light, camera, of)
            if held.clear:
                net = caster.net_count(light, samples)
                np.testing.assert_array_equal(net, held.volumes, err_msg=f"{method} {name} {kind}")


def grid_nearly_edge_on():
    """A bumpy grid and a light so near its plane that float32 cannot tell its triangles' sides."""
    rng = np.random.default_rng(4)
    x, z = np.meshgrid(np.linspace(-1, 1, 33), np.linspace(-1, 1, 33))
    height = 0.3 * x + 0.1 * z + rng.normal(0, 2e-8, x.shape)
    positions = np.stack([x, height, z], axis=-1).reshape(-1, 3).astype(np.float32)
    at = np.arange(32)[:, None] * 33 + np.arange(32)
    quads = np.stack([at, at + 1, at + 34, at, at + 34, at + 33], axis=-1).reshape(-1, 3)
    return Scene(positions, quads), Light.point((2.5, 0.3 * 2.5 + 0.1 * 1.5, 1.5))


@pytest.mark.parametrize("method", SILHOUETTES)
def test_the_reference_edge_keeps_volumes_closed_where_weaker_determinism_fails(method):
    scene, light = grid_nearly_edge_on()
    samples = sample(scene, Camera.look_at((0.5, 2.0, 3.0), (0, 0, 0), width=96, height=64))
    open_pixels = {}
    for determinism in ("reference-edge", "three-edge", "none"):
        caster = METHODS[method](determinism=determinism).prepare(scene)
        open_pixels[determinism] = np.count_nonzero(caster.net_count(light, samples))
    assert open_pixels["reference-edge"] == 0
    assert open_pixels["three-edge"] == 0  # drops triangles, but all three edges of each
    assert open_pixels["none"] > 100


@pytest.mark.parametrize("method", SILHOUETTES)
def test_weaker_determinism_promises_nothing(method):
    soup = SOUPS["cube"]
    for determinism, promise in (("reference-edge", Guarantee.BANDED), ("three-edge", Guarantee.NONE)):
        mask = METHODS[method](determinism=determinism).prepare(soup.scene).shadow(
            Light.point((3, 9, 2)), image_samples(soup.scene, soup)
        )  # fmt: skip
        assert mask.guarantee is promise


@pytest.mark.parametrize("method", VOLUMES)
@pytest.mark.parametrize("counting", ["zpass", "zfail"])
@pytest.mark.parametrize("counter", ["stencil", "float"])
def test_options_change_nothing_outside_the_band(method, counting, counter):
    counted = 0
    for name in ("open_box", "edge_of_128", "opposite_windings", "camera_in_shadow", "touching", "tilted_grid"):
        soup = SOUPS[name]
        samples = image_samples(soup.scene, soup)
        caster = METHODS[method](counting=counting, counter=counter).prepare(soup.scene)
        for kind in ("point", "directional", "inside"):
            light = lights_of(soup)[kind]
            try:
                mask = caster.shadow(light, samples)
            except OptionError:
                assert counting == "zpass", "zfail works everywhere"
                continue
            counted += 1
            assert mask.stats["zfail"] == (counting == "zfail")
            assert verify(soup.scene, light, samples, mask).ok, f"{name} {kind}"
    assert counted >= 10


@pytest.mark.parametrize("method", VOLUMES)
def test_zpass_counts_on_with_the_eye_in_shadow(method):
    soup = SOUPS["camera_in_shadow"]
    light, samples = lights_of(soup)["directional"], image_samples(soup.scene, soup)
    light = Light(np.array(soup.answers[0].light))
    assert around_eye(soup.scene, light, samples.camera).volumes > 0, "the eye is not in shadow"
    mask = METHODS[method](counting="zpass").prepare(soup.scene).shadow(light, samples)
    assert mask.stats["volumes_at_eye"] > 0
    verdict = verify(soup.scene, light, samples, mask)
    assert verdict.ok
    assert mask.in_shadow.any()


def test_an_eye_on_a_face_is_left_to_zfail_and_refused_by_zpass():
    # The eye stands exactly below an edge of a triangle that the light is straight above.
    scene = Scene([(-1, 1, -1), (1, 1, -1), (0, 1, 2), (-9, -1, -9), (9, -1, -9), (0, -1, 9)], [(0, 1, 2), (3, 4, 5)])
    light = Light.directional((0, -1, 0))
    samples = sample(scene, Camera.look_at((0, 0, -1), (0, -1, 3), width=48, height=32))
    mask = METHODS["silhouette-cpu"]().prepare(scene).shadow(light, samples)
    assert mask.stats["zfail"] == 1
    assert verify(scene, light, samples, mask).ok
    with pytest.raises(OptionError, match=r"zpass.*within .* of a shadow volume's face"):
        METHODS["silhouette-cpu"](counting="zpass").prepare(scene).shadow(light, samples)


@pytest.mark.parametrize("method", VOLUMES)
def test_what_is_nearer_than_the_near_plane_casts_but_is_not_seen(method):
    # A plate between the eye and its near plane; seen through, it shadows the floor.
    scene = Scene(
        [
            *((-0.4, 2.6, -0.4), (0.4, 2.6, -0.4), (0.4, 2.6, 0.4), (-0.4, 2.6, 0.4)),
            *((-9, 0, -9), (9, 0, -9), (9, 0, 9), (-9, 0, 9)),
        ],
        [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)],
    )
    camera = Camera.look_at((0.05, 3.0, 0.02), (0.1, 0, 0.03), width=64, height=64, near=1.0)
    light, samples = Light.point((0.3, 4.0, 0.2)), sample(scene, camera)
    assert (samples.triangle[samples.covered] >= 2).all()
    for counting in ("auto", "zfail"):
        mask = METHODS[method](counting=counting).prepare(scene).shadow(light, samples)
        verdict = verify(scene, light, samples, mask)
        assert verdict.ok
        assert 100 < mask.in_shadow.sum() < mask.in_shadow.size - 100


@pytest.mark.parametrize("method", VOLUMES)
def test_caps_of_a_few_triangles_are_those_of_the_right_ones(method):
    """Small triangles of all orientations before the near plane, and others far away, which come first."""
    rng = np.random.default_rng(1)
    away = rng.uniform((-1, 59, -1), (1, 61, 1), (200, 3, 3))
    near = rng.uniform((-0.4, 2.9, -0.4), (0.4, 3.1, 0.4), (30, 1, 3)) + rng.uniform(-0.2, 0.2, (30, 3, 3))
    floor = [[(-9, 0, -9), (9, 0, -9), (9, 0, 9)], [(-9, 0, -9), (9, 0, 9), (-9, 0, 9)]]
    corners = np.concatenate([away, near, floor]).reshape(-1, 3)
    scene = Scene(corners, np.arange(len(corners)).reshape(-1, 3))
    camera = Camera.look_at((0.05, 4.0, 0.02), (0.1, 0, 0.03), width=64, height=64, near=2.5)
    light, samples = Light.point((0.3, 9, 0.2)), sample(scene, camera)
    mask = METHODS[method](counting="zpass").prepare(scene).shadow(light, samples)
    assert mask.stats["caps"] <= 32
    assert verify(scene, light, samples, mask).ok


@pytest.mark.parametrize("method", VOLUMES)
def test_pictures_with_several_samples_in_each_pixel(method):
    soup = SOUPS["icosahedron"]
    camera = Camera.look_at(soup.eye, soup.target, fov_y=60, width=40, height=28)
    samples, light = sample(soup.scene, camera, samples_per_pixel=3), lights_of(soup)["point"]
    mask = METHODS[method]().prepare(soup.scene).shadow(light, samples)
    assert mask.in_shadow.shape == (28, 40, 3)
    verdict = verify(soup.scene, light, samples, mask)
    assert verdict.ok
    assert verdict.mismatches <= 3


@pytest.mark.parametrize("method", VOLUMES)
def test_three_hundred_layers_do_not_overflow(method):
    sheet = np.array([(-1, 0, -1), (1, 0, -1), (0, 0, 1.5)])
    layers = np.concatenate([sheet + np.array([0, 1 + i / 64, 0]) for i in range(256)] + [sheet * 4])
    scene = Scene(layers, np.arange(len(layers)).reshape(-1, 3))
    light = Light.directional((0.05, -1, 0.02))
    samples = sample(scene, Camera.look_at((0, 2.5, 7), (0, 0, 0), width=48, height=36))
    caster = METHODS[method]().prepare(scene)
    assert caster.count(light, samples).max() >= 256
    assert verify(scene, light, samples, caster.shadow(light, samples)).ok
    wrapped = METHODS[method](counter="stencil").prepare(scene).shadow(light, samples)
    assert not verify(scene, light, samples, wrapped).ok, "256 layers are none to a stencil of 8 bits"


@pytest.mark.parametrize("method", VOLUMES)
def test_scenes_that_let_light_through_are_refused_unless_taken_as_solid(method):
    scene = models.pavilion()
    with pytest.raises(
        InputError, match=rf"{method}: wanted solid casters, but \d+ materials let light through \(.*frustum"
    ):
        METHODS[method]().prepare(scene)
    solid = scene.opaque()
    light, samples = models.pavilion_light(), sample(solid, models.pavilion_camera(96, 64))
    verdict = verify(solid, light, samples, METHODS[method]().prepare(solid).shadow(light, samples))
    assert verdict.ok, f"{verdict.outside_band} outside the band"
    assert verdict.mismatches <= 10


@pytest.mark.parametrize("method", VOLUMES)
def test_samples_behind_what_casts_as_solid_are_counted_from_behind(method):
    """What is seen through holes and glass, under the shadows of the same surfaces without: no ray is clear."""
    scene = models.pavilion()
    light, seen = models.pavilion_light(), um.sample_layers(scene, models.pavilion_camera(96, 64))
    solid = scene.opaque()
    caster = METHODS[method]().prepare(solid)
    for layer in seen:
        mask = caster.shadow(light, layer)
        assert mask.stats["zfail"] == 1
        assert verify(solid, light, layer, mask).ok
    with pytest.raises(
        OptionError, match="counting='zpass' cannot be trusted here: the samples are of a scene that lets"
    ):
        METHODS[method](counting="zpass").prepare(solid).shadow(light, seen[0])


@pytest.mark.parametrize("method", VOLUMES)
def test_points_and_parts_of_pictures_are_refused_by_name(method):
    soup = SOUPS["cube"]
    caster = METHODS[method]().prepare(soup.scene)
    light, samples = Light.point((3, 9, 2)), image_samples(soup.scene, soup)
    for other in (ViewSamples.points([(0, 1, 6)]), samples.take(np.arange(5)), samples.rows(3, 9)):
        with pytest.raises(InputError, match=f"{method}: wanted the samples of a whole picture.*frustum"):
            caster.shadow(light, other)


def test_unknown_values_of_options_are_refused_by_name():
    for option in ("counting", "counter", "determinism"):
        with pytest.raises(OptionError, match=rf"silhouette-ts: {option}: wanted one of .*, got 'best'"):
            METHODS["silhouette-ts"](**{option: "best"})


def test_a_camera_far_from_where_its_samples_were_taken_is_another_picture():
    soup = SOUPS["cube"]
    samples = image_samples(soup.scene, soup)
    wider = dataclasses.replace(samples, camera=dataclasses.replace(samples.camera, width=41))
    with pytest.raises(InputError, match="whole picture"):
        um.shadow(soup.scene, Light.point((3, 9, 2)), wider, method="silhouette-ts")


@pytest.mark.parametrize("method", ["silhouette-cpu", "silhouette-ts", "triangle-gs"])
def test_each_update_of_a_stencil_is_a_step_of_one(method):
    soup = SOUPS["wall_on_ground"]
    light, samples = Light.point((3, 9, 2)), image_samples(soup.scene, soup)
    updates = {}
    for counting in ("zpass", "zfail"):
        caster = METHODS[method](counting=counting, counter="stencil").prepare(soup.scene)
        stats = caster.shadow(light, samples).stats
        # Steps up less steps down; the others cancel in pairs.
        steps = int(caster.count(light, samples).sum()) - stats["volumes_at_eye"] * samples.size
        updates[counting] = stats["counter_updates"]
        assert steps != 0 and updates[counting] >= abs(steps)
        assert (updates[counting] - steps) % 2 == 0
    assert updates["zpass"] != updates["zfail"]
