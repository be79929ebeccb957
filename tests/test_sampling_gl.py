"""Visibility by OpenGL beside that of the CPU: the same but where rounding decides, and each such place is proven."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

import umbrae as um
from soups import SOUPS
from truth import in_picture
from umbrae import Camera, GraphicsError, Material, OptionError, Scene, ViewSamples, models
from umbrae.camera import pixel_offsets
from umbrae.gl import context
from umbrae.sampling import gl, sample, sample_gl

pytestmark = pytest.mark.usefixtures("opengl")

SHARED = Path(__file__).parents[2] / "shared/scenes"
ARRAYS = ("triangle", "barycentric", "side", "position", "covered", "depth")
FRONT = Camera.look_at((0, 0, 4), (0, 0, 0), fov_y=90.0, width=33, height=33)


class Differences(NamedTuple):
    """Samples at which two pictures show different triangles, by why they may."""

    snapped: int  # the sample lies within a step of the subpixel grid from an edge of one of the two
    rounded: int  # or within that and the rounding of float32
    tied: int  # or both hold it, and their depths differ by less than rounding
    unproven: NDArray[np.intp]  # flat indices


def differences(scene: Scene, camera: Camera, one: ViewSamples, other: ViewSamples) -> Differences:
    """Prove where `one` and `other` differ; bounds are derived in `sampling/gl.py`."""
    with context.session().current() as current:
        step = 2.0 ** -current.integer("GL_SUBPIXEL_BITS")
    per_pixel = one.shape[2] if len(one.shape) == 3 else 1
    at = np.flatnonzero(one.triangle != other.triangle)
    row, rest = np.divmod(at, camera.width * per_pixel)
    column, k = np.divmod(rest, per_pixel)
    offset_x, offset_y = pixel_offsets(per_pixel)
    x, y = column + offset_x[k], row + offset_y[k]
    vertices = in_picture(scene, camera)

    def facts(samples: ViewSamples):
        t = samples.triangle.reshape(-1)[at]
        there = t >= 0
        corners = vertices[scene.triangles[np.where(there, t, 0)]]
        determinant = np.linalg.det(corners)
        edges = np.cross(corners[:, [1, 2, 0]], corners[:, [2, 0, 1]]) * np.sign(determinant)[:, None, None]
        values = edges[..., 0] * x[:, None] + edges[..., 1] * y[:, None] + edges[..., 2]
        inside = (values / np.hypot(edges[..., 0], edges[..., 1])).min(axis=1)  # pixels, negative outside
        # 1 / distance is linear in the picture.
        inverse = values.sum(axis=1) / np.abs(determinant)
        slope = np.abs(edges[..., :2].sum(axis=1)).sum(axis=1) / np.abs(determinant)
        farthest = np.linalg.norm(scene.positions[scene.triangles[np.where(there, t, 0)]] - camera.eye, axis=2).max(1)
        error = 2.0**-19 * farthest * inverse  # of coordinates, as a share of the distance here
        moved = step + error / camera.pixel_size
        depth_error = inverse * (2.0**-20 + error) + moved * slope
        return there, np.where(there, np.abs(inside), np.inf), moved, inverse, depth_error

    a_there, a_inside, a_moved, a_inverse, a_error = facts(one)
    b_there, b_inside, b_moved, b_inverse, b_error = facts(other)
    snapped = np.minimum(a_inside, b_inside) <= step
    rounded = (a_inside <= a_moved) | (b_inside <= b_moved)
    tied = a_there & b_there & (np.abs(a_inverse - b_inverse) <= a_error + b_error)
    return Differences(
        int(snapped.sum()),
        int((rounded & ~snapped).sum()),
        int((tied & ~rounded).sum()),
        at[~(snapped | rounded | tied)],
    )


def check(scene: Scene, camera: Camera, per_pixel: int = 1) -> Differences:
    """Sample both ways; where the triangle is the same, everything is; where not, it is proven why."""
    cpu, found = sample(scene, camera, per_pixel), sample_gl(scene, camera, per_pixel)
    same = cpu.triangle == found.triangle
    for name in ARRAYS:
        one, other = getattr(cpu, name), getattr(found, name)
        assert one.dtype == other.dtype and one.shape == other.shape
        assert one[same].tobytes() == other[same].tobytes(), name
    check_points(scene, camera, found, ~same)
    result = differences(scene, camera, cpu, found)
    assert not len(result.unproven), f"{len(result.unproven)} samples differ without a reason: {result.unproven[:5]}"
    return result


def check_points(scene: Scene, camera: Camera, found: ViewSamples, chosen: NDArray[np.bool_]) -> None:
    """Every sample is a point of its triangle, and those `chosen` lie hardly beside their places in the picture."""
    found.check(scene)
    u, v = found.barycentric[..., 0], found.barycentric[..., 1]
    assert (u >= 0).all() and (v >= 0).all() and (u.astype(np.float64) + v <= 1).all()
    assert (found.depth[found.covered] >= camera.near).all() and np.isinf(found.depth[~found.covered]).all()
    assert (np.abs(found.side) == found.covered).all()
    at = np.argwhere(chosen & found.covered)
    offset_x, offset_y = pixel_offsets(found.shape[2] if len(found.shape) == 3 else 1)
    k = at[:, 2] if at.shape[1] == 3 else np.zeros(len(at), int)
    places = np.stack([at[:, 1] + offset_x[k], at[:, 0] + offset_y[k]], axis=1)
    seen, distance = pixels_of(found.position[chosen & found.covered], camera)
    corners, _ = pixels_of(scene.positions[scene.triangles[found.triangle[chosen & found.covered]]], camera)
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    ab, ac = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    double_area = np.abs(ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])
    # A place beside an edge is brought to that edge along the line to the opposite corner, which may be slanted.
    slanted = sides**2 / double_area
    rounded = 2.0**-22 * np.abs(scene.bounds).max() / distance / camera.pixel_size  # the position, to float32
    beside = np.linalg.norm(seen - places, axis=1)
    assert (beside <= 2.0**-7 * slanted + rounded).all(), beside.max()


def pixels_of(points: NDArray[np.float32], camera: Camera) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Column and row, with fractions, at which points are seen, and their distances."""
    clip = points.astype(np.float64) @ camera.world_to_clip[:, :3].T + camera.world_to_clip[:, 3]
    x, y = clip[..., 0] / clip[..., 2], clip[..., 1] / clip[..., 2]
    return np.stack([(x + 1) / 2 * camera.width, (1 - y) / 2 * camera.height], axis=-1), clip[..., 2]


# Equal but for rounding


@pytest.mark.parametrize("per_pixel", [1, 3])
@pytest.mark.parametrize("name", SOUPS)
def test_small_scenes(name: str, per_pixel: int) -> None:
    soup = SOUPS[name]
    width, height = (160, 112) if per_pixel == 1 else (101, 151)
    camera = Camera.look_at(soup.eye, soup.target, fov_y=60, width=width, height=height)
    result = check(soup.scene, camera, per_pixel)
    assert result.snapped + result.rounded < 20


def test_the_scene_of_spheres() -> None:
    scene = models.spheres()
    result = check(scene, Camera.frame(scene, width=512, height=512))
    assert 0 < result.snapped < 200 and result.rounded == 0 and result.tied < 20


def test_the_pavilion_with_its_holes() -> None:
    result = check(models.pavilion(), models.pavilion_camera(1280, 720), per_pixel=2)
    assert 0 < result.snapped < 500 and result.rounded < 20 and result.tied < 20


@pytest.mark.parametrize(
    ("file", "eye", "target"),
    [
        ("stanford/dragon_vrip.glb", None, None),
        ("sponza/sponza.gltf", (-60, 300, -40), (1800, 250, -40)),
        ("foliage/smallpine/pine-mask.gltf", None, None),
    ],
)
def test_scenes_from_elsewhere(file: str, eye: tuple | None, target: tuple | None) -> None:
    if not (SHARED / file).exists():
        pytest.skip(f"{file} is not there")
    scene = um.load(SHARED / file)
    if eye is None:
        camera = Camera.frame(scene, width=1024, height=768)
    else:
        camera = Camera.look_at(eye, target, fov_y=75, width=1024, height=768)
    result = check(scene, camera)
    assert result.snapped < 2000 and result.rounded + result.tied < 50


def test_a_proof_can_fail() -> None:
    scene = models.sphere()
    camera = Camera.frame(scene, width=200, height=200)
    by_an_eighth = camera.axes[0] * camera.pixel_size / 8 * np.linalg.norm(camera.eye)
    moved = Camera(camera.eye + by_an_eighth, camera.axes, camera.fov_y, camera.width, camera.height, camera.near)
    result = differences(scene, camera, sample(scene, camera), sample(scene, moved))
    assert len(result.unproven) > 100


# What the rasterizer gets wrong is found out


def times_drawn(scene: Scene, camera: Camera) -> int:
    """How often OpenGL had to draw."""
    clock = um.Clock()
    sample_gl(scene, camera, clock=clock)
    return [name for name, _ in clock.spans].count("rasterize")


def test_needles_that_rounding_gives_an_area_are_not_seen() -> None:
    # Three points on a line each: once moved to the subpixel grid, many are triangles.
    rng = np.random.default_rng(5)
    start = rng.integers(-64, 64, (300, 2)) / 32
    step = rng.integers(-9, 10, (300, 2)) / 64
    corners = np.stack([start, start + 3 * step, start + 10 * step], axis=1)
    positions = np.concatenate([corners, np.zeros((300, 3, 1))], axis=2).reshape(-1, 3)
    camera = Camera.look_at((0.1, 0.2, 4), (0, 0.1, 0), up=(0.2, 1, 0), width=400, height=400)
    needles = Scene(positions, np.arange(900).reshape(-1, 3))
    assert times_drawn(needles, camera) > 1, "the rasterizer sees none of them: choose others"
    assert not sample_gl(needles, camera).covered.any()
    wall = [[-9, -9, -1], [9, -9, -1], [0, 9, -1]]
    behind = Scene(np.concatenate([positions, wall]), np.arange(903).reshape(-1, 3))
    check(behind, camera)
    assert sample_gl(behind, camera).covered.all()


def test_triangles_seen_exactly_edge_on_are_not_seen() -> None:
    positions = np.array([[0, 0, 0], [0, 1, 1], [0, 2, -3], [-5, -5, -9], [5, -5, -9], [0, 9, -9]], np.float32)
    scene = Scene(positions, [[0, 1, 2], [3, 4, 5]])
    found = sample_gl(scene, FRONT)
    assert set(np.unique(found.triangle)) == {-1, 1}
    check(scene, FRONT)


def test_a_rasterizer_that_is_off_by_pixels_is_not_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = SOUPS["cube"].scene
    camera = Camera.look_at(SOUPS["cube"].eye, SOUPS["cube"].target, width=120, height=80)
    cpu = sample(scene, camera)
    true_uniforms = gl.camera_uniforms

    def moved(*arguments):
        uniforms = true_uniforms(*arguments)
        shift = [3 * 2 / camera.width * value for value in uniforms["forward"]]  # three pixels to the right
        return {**uniforms, "picture_x": tuple(np.add(uniforms["picture_x"], shift))}

    monkeypatch.setattr(gl, "camera_uniforms", moved)
    found = sample_gl(scene, camera)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(found, name), getattr(cpu, name))


def test_what_passes_behind_the_eye_is_seen() -> None:
    corners = [[-1e3, 0, -1e3], [-1e3, 0, 1e3], [1e3, 0, 1e3], [1e3, 0, -1e3]]
    scene = Scene(np.array(corners, np.float32), [[0, 1, 2], [0, 2, 3]])
    camera = Camera.look_at((0, 1.7, 0), (0.4, 0, -2), fov_y=100.0, width=480, height=320, near=1e-3)
    result = check(scene, camera)
    assert result.snapped < 5 and result.rounded + result.tied == 0


def test_no_joint_opens_between_what_is_drawn_exactly_and_the_rest() -> None:
    # A star on the ground around the eye, of triangles that the near plane cuts, in a wide ring of others.
    angle = np.linspace(0, 2 * np.pi, 120, endpoint=False) + 0.01
    radius = np.stack([np.where(np.arange(120) % 2, 2.5, 12.0), np.full(120, 90.0)])
    star, rim = np.arange(120), np.arange(120, 240)
    positions = np.stack([radius * np.cos(angle), 0 * radius, radius * np.sin(angle)], axis=-1).reshape(-1, 3)
    triangles = np.concatenate([
        np.stack([np.full(120, 240), star, np.roll(star, -1)], axis=1),
        np.stack([star, rim, np.roll(rim, -1)], axis=1),
        np.stack([star, np.roll(rim, -1), np.roll(star, -1)], axis=1),
    ])  # fmt: skip
    scene = Scene(np.concatenate([positions, np.zeros((1, 3))]), triangles)
    camera = Camera.look_at((0, 1.7, 0), (3.5, 0, 1.3), fov_y=60.0, width=900, height=700, near=1.6)
    deep, seen = gl._too_deep(scene, camera), sample(scene, camera)
    assert deep[:120].all() and seen.covered.mean() > 0.8
    assert 0.1 < deep[seen.triangle[seen.covered]].mean() < 0.9
    assert check(scene, camera).snapped > 5
    np.testing.assert_array_equal(sample_gl(scene, camera).covered, seen.covered)


@pytest.mark.parametrize("near", [3.0, 3.5, 3.999999, 4.0, 4.000001])
def test_nothing_before_the_near_plane_is_seen(near: float) -> None:
    # Walls at distances 3 and 4, and one that the plane cuts.
    positions = np.array([[-9, -9, 1], [9, -9, 1], [0, 0, 1], [-9, 9, 0], [9, 9, 0], [0, 0, 0],
                          [-2, -5, 2.5], [-2, 5, 2.5], [-1, 0, -9]], np.float32)  # fmt: skip
    scene = Scene(positions, np.arange(9).reshape(-1, 3))
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), fov_y=90.0, width=120, height=90, near=near)
    result = check(scene, camera)
    assert result.rounded + result.tied == 0 and sample_gl(scene, camera).covered.any()


# Holes


def square(material: Material, z: float = 0.0) -> Scene:
    """A square [-1, 1]² that fills a 16 x 16 picture of `HOLES`, uv from the top left."""
    corners = np.array([[-1, 1, z], [1, 1, z], [1, -1, z], [-1, -1, z]], np.float32)
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    return Scene(corners, [[0, 3, 2], [0, 2, 1]], uv=uv, materials=[material])


HOLES = Camera.look_at((0, 0, 1), (0, 0, 0), fov_y=90.0, width=16, height=16)


@pytest.mark.parametrize("mode", ["OPAQUE", "MASK", "BLEND"])
def test_holes_are_those_of_the_cpu(mode: str) -> None:
    texture = np.zeros((4, 4, 4), np.uint8)
    texture[:2, :2, 3] = 255
    texture[2:, 2:, 3] = 1
    scene = square(Material(alpha_mode=mode, texture=texture))
    cpu, found = sample(scene, HOLES), sample_gl(scene, HOLES)
    assert cpu.covered.all() == (mode == "OPAQUE") and cpu.covered.any()
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(found, name), getattr(cpu, name))


@pytest.mark.parametrize("masked_first", [False, True])
def test_where_a_masked_triangle_ties_with_an_opaque_one_the_lower_index_wins(masked_first: bool) -> None:
    corners = np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], np.float32)
    scene = Scene(
        corners,
        [[0, 1, 2], [0, 1, 2]],
        material_id=np.array([0, 1] if masked_first else [1, 0]),
        materials=[Material(alpha_mode="MASK"), Material()],
    )
    found = sample_gl(scene, FRONT)
    assert found.covered.any() and (found.triangle[found.covered] == 0).all()
    check(scene, FRONT)


# Degenerate input, bad input, company


def test_an_empty_scene_is_background() -> None:
    for scene in (Scene([], []), Scene(np.zeros((3, 3), np.float32), [])):
        found = sample_gl(scene, FRONT)
        assert found.shape == (33, 33) and not found.covered.any() and (found.triangle == -1).all()


def test_one_pixel_and_many_samples() -> None:
    scene = models.sphere()
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), width=1, height=1)
    found = sample_gl(scene, camera, 9)
    assert found.shape == (1, 1, 9)
    check(scene, camera, 9)


@pytest.mark.parametrize("size", [1e-18, 1e-6, 1e6, 1e18])
def test_scale_does_not_matter(size: float) -> None:
    scene = models.sphere()
    scaled = Scene(scene.positions * np.float32(size), scene.triangles)
    result = check(scaled, Camera.look_at(np.array([2.0, 1.5, 2.0]) * size, (0, 0, 0), width=90, height=60))
    assert result.snapped + result.rounded + result.tied < 20


def test_coordinates_up_to_the_limit() -> None:
    rng = np.random.default_rng(1)
    positions = (rng.uniform(-1, 1, (60, 3)) * 10.0 ** rng.integers(-18, 19, (60, 1))).astype(np.float32)
    scene = Scene(positions, rng.integers(0, 60, (80, 3)))
    camera = Camera.look_at((0.1, 0.2, 0.3), (0, 0, 0), width=40, height=40)
    np.testing.assert_array_equal(sample_gl(scene, camera).covered, sample(scene, camera).covered)


@pytest.mark.parametrize("count", [0, -1, 1.5, "4"])
def test_samples_per_pixel_must_be_a_whole_number(count: object) -> None:
    with pytest.raises(OptionError, match="samples_per_pixel"):
        sample_gl(models.sphere(), FRONT, samples_per_pixel=count)


def test_a_picture_too_large_for_the_driver_is_refused_by_name() -> None:
    with context.session().current() as current:
        width = current.integer("GL_MAX_TEXTURE_SIZE") + 1
    if width > 1 << 16:
        pytest.skip("the driver takes any picture that a camera does")
    with pytest.raises(GraphicsError, match=f"{width} x 1 pixels is too large"):
        sample_gl(models.sphere(), Camera.look_at((0, 0, 4), (0, 0, 0), width=width, height=1))


def test_without_opengl_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(context, "_kept", None)
    monkeypatch.setenv("UMBRAE_GL", "off")
    with pytest.raises(GraphicsError, match="switched off"):
        sample_gl(models.sphere(), FRONT)


def test_methods_and_visibility_share_the_context_in_turn() -> None:
    scene = SOUPS["wall_on_ground"].scene
    camera = Camera.look_at(SOUPS["wall_on_ground"].eye, SOUPS["wall_on_ground"].target, width=120, height=80)
    light = um.Light.point((1, 9, 2))
    caster = um.METHODS["silhouette-cpu"]().prepare(scene)
    samples = sample(scene, camera)
    mask = caster.shadow(light, samples).in_shadow
    for _ in range(3):
        found = sample_gl(scene, camera, 2)
        np.testing.assert_array_equal(caster.shadow(light, samples).in_shadow, mask)
    np.testing.assert_array_equal(sample_gl(scene, camera, 2).triangle, found.triangle)
    assert mask.any()
