"""Primary visibility: watertight, exact at the edges, right in depth, side, barycentrics and position."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import umbrae.memory
from truth import in_picture
from umbrae.camera import Camera
from umbrae.errors import CapacityError, OptionError
from umbrae.material import Material
from umbrae.samples import ViewSamples, surface_positions
from umbrae.sampling import sample
from umbrae.sampling.coverage import determinant_sign
from umbrae.scene import Scene

FRONT = Camera.look_at((0, 0, 4), (0, 0, 0), fov_y=90.0, width=33, height=33)


def jittered_grid(cells: int, seed: int, jitter: float) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """A square [-8, 8]² at z = 0, cut into 2 cells² counter-clockwise triangles with random diagonals."""
    random = np.random.default_rng(seed)
    steps = np.linspace(-8, 8, cells + 1)
    x, y = np.meshgrid(steps, steps)
    points = np.stack([x, y, np.zeros_like(x)], axis=-1)
    points[1:-1, 1:-1, :2] += random.uniform(-jitter, jitter, (cells - 1, cells - 1, 2)) * 16 / cells
    triangles = []
    for i in range(cells):
        for j in range(cells):
            a, b = i * (cells + 1) + j, i * (cells + 1) + j + 1
            c, d = b + cells + 1, a + cells + 1
            triangles += [[a, b, c], [a, c, d]] if random.random() < 0.5 else [[a, b, d], [b, c, d]]
    return points.reshape(-1, 3).astype(np.float32), np.array(triangles, np.int32)


def times_covered(positions: NDArray[np.float32], triangles: NDArray[np.int32], camera: Camera) -> NDArray[np.int64]:
    """How many of the triangles cover each pixel, each drawn alone."""
    return sum(sample(Scene(positions, [t]), camera).covered.astype(np.int64) for t in triangles)


def sphere(rows: int, columns: int) -> Scene:
    """A closed unit sphere, counter-clockwise from outside."""
    theta = np.linspace(0, np.pi, rows + 1)[:, None]
    phi = np.linspace(0, 2 * np.pi, columns, endpoint=False)[None, :]
    points = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta) + 0 * phi, np.sin(theta) * np.sin(phi)], axis=-1)
    points[0], points[-1] = (0, 1, 0), (0, -1, 0)
    at = np.arange((rows + 1) * columns).reshape(rows + 1, columns)
    a, b = at[:-1], np.roll(at, -1, axis=1)[:-1]
    c, d = np.roll(at, -1, axis=1)[1:], at[1:]
    quads = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], axis=2)
    return Scene(points.reshape(-1, 3).astype(np.float32), quads.reshape(-1, 3))


def ground(size: float) -> Scene:
    """Two huge triangles at y = 0, seen from above counter-clockwise."""
    corners = [[-size, 0, -size], [-size, 0, size], [size, 0, size], [size, 0, -size]]
    return Scene(np.array(corners, np.float32), [[0, 1, 2], [0, 2, 3]])


def pixels_of(points: NDArray[np.floating], camera: Camera) -> NDArray[np.float64]:
    """Column and row, with fractions, at which points are seen."""
    clip = points.astype(np.float64) @ camera.world_to_clip[:, :3].T + camera.world_to_clip[:, 3]
    x, y = clip[..., 0] / clip[..., 2], clip[..., 1] / clip[..., 2]
    return np.stack([(x + 1) / 2 * camera.width, (1 - y) / 2 * camera.height], axis=-1)


# Watertightness


@pytest.mark.parametrize(
    "camera",
    [
        FRONT,
        Camera.look_at((0, 0, 4), (0, 0, 0), fov_y=90.0, width=32, height=32),
        Camera.look_at((0.3, -0.2, 4), (0.1, 0.4, 0), up=(0.3, 1, 0.1), fov_y=60.0, width=40, height=31),
    ],
)
@pytest.mark.parametrize("jitter", [0.0, 0.35])
def test_every_pixel_of_a_triangulated_square_is_covered_once(camera: Camera, jitter: float) -> None:
    positions, triangles = jittered_grid(8, seed=3, jitter=jitter)
    count = times_covered(positions, triangles, camera)
    assert (count == 1).all(), f"pixels {np.argwhere(count != 1)[:5].tolist()} covered {count[count != 1][:5]} times"


@pytest.mark.parametrize("turn", [0.0, 0.1, 1.0])
def test_a_vertex_at_a_pixel_centre_is_covered_once(turn: float) -> None:
    spokes = np.linspace(0, 2 * np.pi, 12, endpoint=False) + turn
    rim = np.stack([9 * np.cos(spokes), 9 * np.sin(spokes), 0 * spokes], axis=1)
    positions = np.concatenate([np.zeros((1, 3)), rim]).astype(np.float32)
    triangles = np.array([[0, 1 + i, 1 + (i + 1) % 12] for i in range(12)], np.int32)
    upright = Camera.look_at((0, 0, 4), (0, 0, 0), fov_y=90.0, width=33, height=33)
    tilted = Camera.look_at((0.7, 1.3, 3.1), (0, 0, 0), up=(0.2, 1, 0), fov_y=40.0, width=33, height=33)
    for camera in (upright, tilted):
        assert (times_covered(positions, triangles, camera) == 1).all()


def test_triangles_that_pass_behind_the_eye_share_their_edges() -> None:
    scene = ground(1000.0)
    center = np.array([[3, 0, -2]], np.float32)
    positions = np.concatenate([scene.positions, center])
    triangles = np.array([[i, (i + 1) % 4, 4] for i in range(4)], np.int32)
    camera = Camera.look_at((0, 1.7, 0), (0.4, 0, -2), fov_y=100.0, width=48, height=32, near=1e-3)
    whole = sample(scene, camera).covered
    assert whole.any()
    np.testing.assert_array_equal(times_covered(positions, triangles, camera), whole.astype(int))


def test_a_closed_mesh_around_the_eye_covers_everything_from_inside() -> None:
    scene = sphere(16, 24)
    for target in ((0, 1, 0), (1, 0.2, 0.3), (-0.5, -0.7, 0.1)):
        seen = sample(scene, Camera.look_at((0, 0, 0), target, fov_y=120.0, width=61, height=61, near=1e-4))
        assert seen.covered.all()
        assert (seen.side == -1).all()


# Against independent computations


def exact_visible(scene: Scene, camera: Camera) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Nearest triangle per pixel by rational arithmetic, and where no edge passes through the very centre."""
    corners = [[Fraction(float(x)) for x in vertex] for vertex in in_picture(scene, camera)]
    near = Fraction(camera.near)
    shape = (camera.height, camera.width)
    nearest, clear = np.full(shape, -1), np.ones(shape, bool)
    for row, column in np.ndindex(shape):
        px, py = Fraction(2 * column + 1, 2), Fraction(2 * row + 1, 2)
        best: Fraction | None = None
        for t, (i, j, k) in enumerate(scene.triangles):
            a, b, c = ([v[0] - px * v[2], v[1] - py * v[2]] for v in (corners[i], corners[j], corners[k]))
            parts = [p[0] * q[1] - p[1] * q[0] for p, q in ((b, c), (c, a), (a, b))]
            determinant = sum(e * corners[v][2] for e, v in zip(parts, (i, j, k), strict=True))
            if determinant == 0 or any(e * determinant < 0 for e in parts):
                continue
            depth = determinant / sum(parts)
            if any(e == 0 for e in parts):
                clear[row, column] = False
            elif depth >= near and (best is None or depth < best):
                best, nearest[row, column] = depth, t
    return nearest, clear


@pytest.mark.parametrize("seed", range(4))
def test_the_nearest_triangle_is_that_of_rational_arithmetic(seed: int) -> None:
    random = np.random.default_rng(seed)
    # Corners on a coarse grid, some behind the eye, so that many edges and vertices coincide.
    positions = random.integers(-3, 4, (40, 3)).astype(np.float32)
    scene = Scene(positions, random.integers(0, 40, (25, 3)))
    eye, target = random.uniform(-3, 3, 3), random.uniform(-0.5, 0.5, 3)
    camera = Camera.look_at(eye, target, fov_y=80.0, width=15, height=11, near=0.3)
    nearest, clear = exact_visible(scene, camera)
    seen = sample(scene, camera).triangle
    assert clear.mean() > 0.9 and (nearest[clear] >= 0).mean() > 0.2
    np.testing.assert_array_equal(seen[clear], nearest[clear])


def test_small_and_large_triangles_agree_with_rays() -> None:
    random = np.random.default_rng(5)
    center = random.uniform(-2, 2, (300, 1, 3))
    size = 10 ** random.uniform(-1.5, 0.5, (300, 1, 1))
    corners = (center + size * random.uniform(-1, 1, (300, 3, 3))).astype(np.float32)
    scene = Scene(corners.reshape(-1, 3), np.arange(900).reshape(-1, 3))
    camera = Camera.look_at((1, 2, 6), (0, 0, 0), fov_y=55.0, width=64, height=48)
    seen = sample(scene, camera)

    tan = math.tan(math.radians(55.0) / 2)
    columns, rows = np.meshgrid(np.arange(64) + 0.5, np.arange(48) + 0.5)
    right, up = (2 * columns / 64 - 1) * tan * 64 / 48, (1 - 2 * rows / 48) * tan
    rays = np.stack([right, up, np.ones_like(up)], axis=-1) @ camera.axes  # one unit along the view direction
    a, b, c = np.moveaxis(corners.astype(np.float64), 1, 0)
    normal = np.cross(b - a, c - a)
    distance = ((a - camera.eye) * normal).sum(-1) / (rays @ normal.T)
    hits = camera.eye + distance[..., None] * rays[:, :, None, :] - a
    share_b = (np.cross(hits, c - a) * normal).sum(-1) / (normal * normal).sum(-1)
    share_c = (np.cross(b - a, hits) * normal).sum(-1) / (normal * normal).sum(-1)
    inner = np.minimum(np.minimum(share_b, share_c), 1 - share_b - share_c)
    distance = np.where((inner >= 0) & (distance >= camera.near), distance, np.inf)
    nearest = np.where(np.isfinite(distance.min(-1)), distance.argmin(-1), -1)
    # Rounding moves a hit by far less than 1e-9 of the triangle; leave out pixels where that could matter.
    clear = (np.abs(inner) > 1e-9).all(-1)
    assert clear.mean() > 0.5
    np.testing.assert_array_equal(seen.triangle[clear], nearest[clear])
    hit = clear & (nearest >= 0)
    assert hit.sum() > 1000
    np.testing.assert_allclose(seen.depth[hit], distance.min(-1)[hit], rtol=1e-6)
    expected = np.stack([share_b, share_c], -1)[hit, nearest[hit]]
    np.testing.assert_allclose(seen.barycentric[hit], expected, atol=2.0**-24 + 1e-9)
    front = ((camera.eye - a) * normal).sum(-1) > 0
    np.testing.assert_array_equal(seen.side[hit], np.where(front, 1, -1)[nearest[hit]])


ORDINARY = st.floats(-1e6, 1e6)
ROW = st.tuples(ORDINARY, ORDINARY, ORDINARY)


@settings(max_examples=150, deadline=None)
@given(ROW, ROW, st.floats(-8, 8), st.floats(-8, 8), st.integers(-2, 2))
def test_determinant_signs_are_exact(
    p: tuple[float, ...], q: tuple[float, ...], s: float, t: float, nudge: int
) -> None:
    # A third row that depends on the other two but for its rounding.
    r = [s * x + t * y for x, y in zip(p, q, strict=True)]
    r[0] += nudge * math.ulp(r[0])
    m = [[Fraction(x) for x in row] for row in (p, q, r)]
    cross = [m[0][(i + 1) % 3] * m[1][(i + 2) % 3] - m[0][(i + 2) % 3] * m[1][(i + 1) % 3] for i in range(3)]
    determinant = sum(x * y for x, y in zip(cross, m[2], strict=True))
    smallest = min((abs(x) for row in (p, q, r) for x in row if x), default=1.0)
    if smallest > 1e-90:  # below, products of three leave float64's range
        assert determinant_sign(p, q, tuple(r)) == (determinant > 0) - (determinant < 0)


# Points on the surface


def check_points(scene: Scene, seen: ViewSamples, offsets: NDArray[np.float64]) -> None:
    """Barycentrics are legal, and positions follow from them and lie where the sample looks."""
    camera = seen.camera
    assert camera is not None and seen.depth is not None
    u, v = seen.barycentric[..., 0].astype(np.float64), seen.barycentric[..., 1].astype(np.float64)
    assert (u >= 0).all() and (v >= 0).all() and (u + v <= 1).all()
    np.testing.assert_array_equal(u * 2**24 % 1, 0)
    np.testing.assert_array_equal(v * 2**24 % 1, 0)
    hit = seen.covered
    np.testing.assert_array_equal(
        seen.position[hit], surface_positions(scene, seen.triangle[hit], seen.barycentric[hit])
    )
    rows, columns = np.indices(hit.shape[:2])
    wanted = np.stack([columns, rows], axis=-1)
    if hit.ndim == 3:
        wanted = wanted[:, :, None, :]
    # Half a step of float32 in the position and of 2**-24 in each barycentric, seen from its distance.
    extent = np.abs(scene.positions).max()
    pixels_per_unit = camera.height / (2 * math.tan(math.radians(camera.fov_y) / 2)) / seen.depth[hit]
    miss = np.abs(pixels_of(seen.position[hit], camera) - (wanted + offsets)[hit]).max(-1)
    assert (miss <= 8 * extent * 2.0**-24 * pixels_per_unit + 1e-9).all()
    depth = seen.position[hit].astype(np.float64) @ camera.axes[2] - camera.eye @ camera.axes[2]
    np.testing.assert_allclose(seen.depth[hit], depth, rtol=1e-6, atol=8 * extent * 2.0**-24)


def test_positions_lie_in_their_pixels() -> None:
    scene = sphere(20, 30)
    camera = Camera.look_at((2, 1.5, 2), (0, 0, 0), width=90, height=70)
    seen = sample(scene, camera)
    assert 0.1 < seen.covered.mean() < 0.9
    check_points(scene, seen, np.array([0.5, 0.5]))


def test_background_is_empty() -> None:
    seen = sample(sphere(8, 12), Camera.look_at((0, 0, 9), (0, 0, 0), width=40, height=20))
    none = ~seen.covered
    assert none.any() and seen.depth is not None
    assert (seen.triangle[none] == -1).all() and (seen.side[none] == 0).all()
    assert (seen.barycentric[none] == 0).all() and (seen.position[none] == 0).all()
    assert np.isinf(seen.depth[none]).all() and np.isfinite(seen.depth[~none]).all()


def test_rows_go_down_and_columns_go_right() -> None:
    # One small triangle in the upper right quarter.
    scene = Scene(np.array([[1, 1, 0], [3, 1, 0], [1, 3, 0]], np.float32), [[0, 1, 2]])
    covered = sample(scene, FRONT).covered
    assert covered[:17, 16:].any()
    assert not covered[17:].any() and not covered[:, :16].any()


@pytest.mark.parametrize(("triangle", "side"), [([0, 1, 2], 1), ([0, 2, 1], -1)])
def test_side_follows_the_winding(triangle: list[int], side: int) -> None:
    scene = Scene(np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], np.float32), [triangle])
    seen = sample(scene, FRONT)
    assert (seen.side[seen.covered] == side).all() and seen.covered.any()
    back = sample(scene, Camera.look_at((0, 0, -4), (0, 0, 0), width=33, height=33))
    assert (back.side[back.covered] == -side).all() and back.covered.any()


# Near plane


@pytest.mark.parametrize("size", [10.0, 1e4, 1e7])
def test_standing_on_a_large_ground(size: float) -> None:
    scene = ground(size)
    camera = Camera.look_at((0, 1.5, 0), (0, 1.5, -1), fov_y=90.0, width=40, height=40, near=0.01)
    seen = sample(scene, camera)
    # Row r looks down by (r + 0.5) / 20 - 1 per unit of depth, and meets the ground at this depth:
    depth = 1.5 / ((np.arange(20, 40) + 0.5) / 20 - 1)
    across = depth[:, None] * np.abs((np.arange(40) + 0.5) / 20 - 1)
    on_ground = (depth[:, None] <= size) & (across <= size)
    assert not seen.covered[:20].any() and seen.depth is not None
    np.testing.assert_array_equal(seen.covered[20:], on_ground)
    expected = np.broadcast_to(depth[:, None], (20, 40))[on_ground]
    np.testing.assert_allclose(seen.depth[20:][on_ground], expected, rtol=1e-6)
    assert (seen.side[20:][on_ground] == 1).all()


def test_nothing_nearer_than_the_near_plane_is_seen() -> None:
    camera = Camera.look_at((0, 1.5, 0), (0, 1.5, -1), fov_y=90.0, width=40, height=40, near=4.0)
    seen = sample(ground(1e3), camera)
    depth = 1.5 / ((np.arange(20, 40) + 0.5) / 20 - 1)
    np.testing.assert_array_equal(seen.covered[20:], np.repeat((depth >= 4.0)[:, None], 40, axis=1))


def test_what_lies_behind_is_not_seen() -> None:
    square, triangles = jittered_grid(4, seed=0, jitter=0.2)
    assert sample(Scene(square, triangles), Camera.look_at((0, 0, 4), (0, 0, 1))).covered.all()
    assert not sample(Scene(square, triangles), Camera.look_at((0, 0, 4), (0, 0, 5))).covered.any()


# Alpha


def masked_square(material: Material, colors: NDArray[np.float32] | None = None) -> Scene:
    """A square [-2, 2]² at z = 0 of a material, uv (0, 0) at its top left, before a grey wall at z = -1."""
    square = np.array([[-2, 2, 0], [-2, -2, 0], [2, -2, 0], [2, 2, 0]], np.float32)
    wall = square * 8 - np.array([0, 0, 1], np.float32)
    uv = np.array([[0, 0], [0, 1], [1, 1], [1, 0]] * 2, np.float32)
    if colors is not None:
        colors = np.concatenate([colors, np.ones((4, 4), np.float32)])
    return Scene(
        np.concatenate([square, wall]),
        [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
        materials=[material, Material()],
        material_id=[0, 0, 1, 1],
        uv=uv,
        colors=colors,
    )


# The square fills the middle half of the 32 x 32 picture.
SQUARE = Camera.look_at((0, 0, 4), (0, 0, 0), fov_y=90.0, width=32, height=32)


def shown(scene: Scene) -> NDArray[np.bool_]:
    """Where in the middle half of the picture the square hides the wall."""
    seen = sample(scene, SQUARE)
    assert seen.covered.all() and (seen.triangle[:8] >= 2).all()
    return seen.triangle[8:24, 8:24] < 2


def test_an_alpha_mask_is_seen_through_where_the_texture_says_so() -> None:
    texture = np.zeros((4, 4, 4), np.uint8)
    texture[:2, :2, 3] = 255  # opaque in the top left quarter
    scene = masked_square(Material(alpha_mode="MASK", texture=texture))
    # Pixel i is at texel coordinate i / 4 - 0.375. Alpha along an axis, bilinear, repeated: 1 within [0, 1],
    # down to 0 over the texel after and the texel before.
    at = np.arange(16) / 4 - 0.375
    along = np.clip(np.minimum(at + 1, 2 - at), 0, 1) + np.clip(at - 3, 0, 1)
    np.testing.assert_array_equal(shown(scene), np.outer(along, along) >= 0.5)


def test_opaque_surfaces_have_no_holes_and_blended_ones_where_nothing_is_left() -> None:
    empty, faint = np.zeros((4, 4, 4), np.uint8), np.full((4, 4, 4), 1, np.uint8)
    assert shown(masked_square(Material((1, 1, 1, 0), alpha_mode="OPAQUE", texture=empty))).all()
    assert shown(masked_square(Material(alpha_mode="BLEND", texture=faint))).all()
    assert not shown(masked_square(Material(alpha_mode="BLEND", texture=empty))).any()


def test_base_and_vertex_alpha_count() -> None:
    half = np.full((2, 2, 4), 255, np.uint8)
    assert shown(masked_square(Material((1, 1, 1, 0.6), "MASK", 0.5, texture=half))).all()
    assert not shown(masked_square(Material((1, 1, 1, 0.4), "MASK", 0.5, texture=half))).any()
    fade = np.array([[1, 1, 1, 0], [1, 1, 1, 0], [1, 1, 1, 1], [1, 1, 1, 1]], np.float32)  # 0 left to 1 right
    visible = shown(masked_square(Material(alpha_mode="MASK", alpha_cutoff=0.5), fade))
    np.testing.assert_array_equal(visible, np.broadcast_to(np.arange(16) >= 8, (16, 16)))


# Order, threads, supersampling, memory


@pytest.mark.parametrize("order", [[0, 1, 2], [1, 2, 0], [2, 1, 0], [0, 2, 1]])
def test_the_first_of_coincident_triangles_wins(order: list[int]) -> None:
    scene = sphere(12, 18)
    doubled = np.concatenate([scene.triangles, scene.triangles[:, order]])
    camera = Camera.look_at((2.1, 1.3, 1.7), (0.1, 0, 0), width=80, height=60)
    seen = sample(Scene(scene.positions, doubled), camera)
    alone = sample(scene, camera)
    np.testing.assert_array_equal(seen.triangle, alone.triangle)
    np.testing.assert_array_equal(seen.side, alone.side)
    turned = sample(Scene(scene.positions, doubled[::-1]), camera)
    assert (turned.triangle[turned.covered] < len(scene.triangles)).all()


def test_the_result_does_not_depend_on_the_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, camera = sphere(150, 150), Camera.look_at((2, 1.5, 2), (0, 0, 0), width=200, height=150)
    assert len(scene.triangles) > 2 * 16384  # several chunks
    monkeypatch.setenv("UMBRAE_THREADS", "1")
    one = sample(scene, camera)
    monkeypatch.setenv("UMBRAE_THREADS", "4")
    four = sample(scene, camera)
    for name in ("triangle", "barycentric", "side", "position", "covered", "depth"):
        assert getattr(one, name).tobytes() == getattr(four, name).tobytes(), name


@pytest.mark.parametrize("count", [2, 4, 5])
def test_supersampling(count: int) -> None:
    scene, camera = sphere(20, 30), Camera.look_at((2, 1.5, 2), (0, 0, 0), width=50, height=40)
    seen = sample(scene, camera, samples_per_pixel=count)
    assert seen.shape == (40, 50, count) and seen.position.shape == (40, 50, count, 3)
    middle = pixels_of(seen.position[20, 25], camera) - (25, 20)
    assert (middle > 0).all() and (middle < 1).all()
    np.testing.assert_allclose(middle.mean(axis=0), 0.5, atol=1e-4)
    distances = np.linalg.norm(middle[:, None] - middle[None], axis=-1)[~np.eye(count, dtype=bool)]
    assert distances.min() > 0.25
    check_points(scene, seen, middle)


def test_one_sample_per_pixel_is_the_middle_one_of_three() -> None:
    scene, camera = sphere(20, 30), Camera.look_at((2, 1.5, 2), (0, 0, 0), width=50, height=40)
    one, three = sample(scene, camera), sample(scene, camera, samples_per_pixel=3)
    np.testing.assert_array_equal(one.triangle, three.triangle[:, :, 1])
    np.testing.assert_array_equal(one.position, three.position[:, :, 1])


@pytest.mark.parametrize("count", [0, -1, 1.5, "4"])
def test_samples_per_pixel_must_be_a_whole_number(count: object) -> None:
    with pytest.raises(OptionError, match="samples_per_pixel"):
        sample(sphere(4, 4), FRONT, samples_per_pixel=count)  # type: ignore[arg-type]


def test_a_picture_that_does_not_fit_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(umbrae.memory, "available_bytes", lambda: 1 << 30)
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), width=65536, height=65536)
    with pytest.raises(CapacityError, match=r"65536 x 65536 .* 120\.00 GiB .* 1\.00 GiB"):
        sample(sphere(4, 4), camera)


# Degenerate input


def test_an_empty_scene_is_background() -> None:
    for scene in (Scene([], []), Scene(np.zeros((3, 3), np.float32), [])):
        seen = sample(scene, FRONT)
        assert seen.shape == (33, 33) and not seen.covered.any()


def test_one_pixel() -> None:
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), width=1, height=1)
    seen = sample(sphere(8, 12), camera)
    assert seen.shape == (1, 1) and seen.covered.all()
    np.testing.assert_allclose(seen.position[0, 0], (0, 0, 1), atol=0.1)


def test_triangles_without_area_or_seen_edge_on_are_not_seen() -> None:
    positions = np.array([[0, 0, 0], [1, 1, 0], [2, 2, 0], [0, 0, 1], [0, 1, 0], [0, 0, 5]], np.float32)
    points_and_needles = [[0, 0, 0], [0, 1, 1], [0, 1, 2], [2, 0, 1]]
    edge_on = [[0, 3, 4], [0, 4, 5], [3, 4, 5]]  # in the plane x = 0, which contains the eye
    assert not sample(Scene(positions, points_and_needles + edge_on), FRONT).covered.any()


@pytest.mark.parametrize("size", [1e-18, 1e-6, 1e6, 1e18])
def test_scale_does_not_matter(size: float) -> None:
    scene = sphere(16, 24)
    scaled = Scene((scene.positions * np.float32(size)), scene.triangles)
    eye = np.array([2.0, 1.5, 2.0])
    small = sample(scene, Camera.look_at(eye, (0, 0, 0), width=60, height=40))
    large = sample(scaled, Camera.look_at(eye * size, (0, 0, 0), width=60, height=40))
    assert np.isfinite(large.position).all() and large.depth is not None
    assert not np.isnan(large.depth).any()
    # The scaled vertices are rounded anew: a pixel at an edge may fall to the other side.
    assert (small.triangle != large.triangle).mean() < 0.002


def test_coordinates_up_to_the_limit_give_numbers() -> None:
    random = np.random.default_rng(1)
    positions = (random.uniform(-1, 1, (60, 3)) * 10.0 ** random.integers(-18, 19, (60, 1))).astype(np.float32)
    scene = Scene(positions, random.integers(0, 60, (80, 3)))
    seen = sample(scene, Camera.look_at((0.1, 0.2, 0.3), (0, 0, 0), width=40, height=40))
    assert seen.depth is not None
    assert np.isfinite(seen.position).all() and not np.isnan(seen.depth).any()
    assert ((seen.barycentric >= 0) & (seen.barycentric <= 1)).all()
