"""Smooth outlines: Phong tessellation without cracks, and what is seen of it as samples of the coarse mesh."""

import numpy as np
import pytest

import umbrae as um
from umbrae.geometry.edges import edges, weld
from umbrae.geometry.tessellation import tessellate
from umbrae.models.builder import Builder
from umbrae.models.sphere_scene import sphere

SOLID = um.Material(name="solid")
FRONT = um.Camera.look_at((0.2, 0.3, 4), (0, 0, 0), fov_y=40, width=200, height=200)


def icosphere() -> um.Scene:
    """The unit icosahedron, each face cut into four."""
    phi = (1 + 5**0.5) / 2
    points = [p for a in (-1, 1) for b in (-phi, phi) for p in ((0, a, b), (a, b, 0), (b, 0, a))]
    vertices = np.array(points) / np.hypot(1, phi)
    near = np.linalg.norm(vertices[:, None] - vertices, axis=2) < 1.1
    faces = [
        (i, j, k) for i in range(12) for j in range(i) for k in range(j) if near[i, j] and near[j, k] and near[k, i]
    ]
    assert len(faces) == 20
    corners = vertices[faces]
    inwards = np.linalg.det(corners) < 0
    corners[inwards] = corners[inwards, ::-1]
    middles = (corners + np.roll(corners, -1, axis=1)) / 2
    middles /= np.linalg.norm(middles, axis=2, keepdims=True)
    a, b, c, ab, bc, ca = (*corners.transpose(1, 0, 2), *middles.transpose(1, 0, 2))
    points = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3)
    return um.Scene(points.astype(np.float32), np.arange(240).reshape(80, 3), normals=points)


def creased(seed: int) -> um.Scene:
    """A closed sphere whose every corner has a normal of its own, some none at all."""
    random = np.random.default_rng(seed)
    ball = sphere(segments=8, rings=5)
    corners = ball.positions[ball.triangles].reshape(-1, 3)
    normals = corners + random.normal(0, 0.25, corners.shape)
    normals[random.random(len(normals)) < 0.1] = 0
    return um.Scene(corners, np.arange(len(corners)).reshape(-1, 3), normals=normals)


def drum() -> um.Scene:
    """A closed cylinder with smooth sides and flat ends."""
    build = Builder([SOLID])
    build.lathe([(1.0, -1.0), (1.0, 1.0)], (0, 0, 0), "solid", 8)
    return build.scene()


def phong(corners, normals, weights):
    """Points `(n, 3)` at barycentrics `(n, 3)` of triangles with corners and normals `(n, 3, 3)`."""
    flat = np.einsum("ni,nix->nx", weights, corners)
    above = np.einsum("nix,nix->ni", flat[:, None] - corners, normals)
    projected = flat[:, None] - above[..., None] * normals
    return (flat + np.einsum("ni,nix->nx", weights, projected)) / 2


def test_points_are_those_of_the_formula():
    corners = np.array([(0, 0, 0), (1, 0, 0.1), (0.1, 0.9, 0)], np.float32).astype(np.float64)
    normals = np.array([(-0.2, -0.1, 1), (0.3, 0, 1), (0, 0.25, 1)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    fine = tessellate(corners.astype(np.float32), np.array([(0, 1, 2)], np.int32), normals.astype(np.float32), 3)
    assert len(fine.triangles) == 9 and (fine.source == 0).all()
    u, v = fine.corners[fine.place].reshape(-1, 2).T
    weights = np.stack([1 - u - v, u, v], axis=1)
    points = fine.positions[fine.triangles].reshape(-1, 3)
    every = np.broadcast_to(corners, (27, 3, 3)), np.broadcast_to(normals, (27, 3, 3))
    np.testing.assert_allclose(points, phong(*every, weights), atol=2e-7)
    assert (np.linalg.norm(points - weights @ corners, axis=1) > 0.005)[weights.max(axis=1) < 1].all()


@pytest.mark.parametrize("scene", [icosphere(), creased(1), drum()], ids=["smooth", "creased", "drum"])
def test_no_edge_opens(scene):
    fine = tessellate(scene.positions, scene.triangles, scene.normals, 5)
    assert len(fine.triangles) == 25 * len(scene.triangles)
    topology = edges(weld(fine.positions)[fine.triangles])
    assert len(topology.degenerate) == 0 and (topology.count == 2).all() and (topology.balance == 0).all()
    # From within, a crack would show the sky.
    for target in np.concatenate([np.eye(3), -np.eye(3)]):
        inside = um.Camera.look_at((0, 0, 0), target, fov_y=90, width=300, height=300)
        assert um.sample_tessellated(scene, inside, 5).covered.all()


def test_the_outline_of_a_sphere_is_nearly_a_circle():
    scene = icosphere()
    x, y = np.meshgrid(np.arange(200) + 0.5, np.arange(200) + 0.5)
    right, up, forward = FRONT.axes
    rays = forward + FRONT.pixel_size * ((x - 100)[..., None] * right - (y - 100)[..., None] * up)
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    ball = np.linalg.norm(np.cross(rays, FRONT.eye), axis=2) <= 1
    wrong = [np.count_nonzero(um.sample_tessellated(scene, FRONT, level).covered != ball) for level in (1, 2, 8)]
    # Half a side is 16 degrees: the quadratic's middle lies at cos(16) (1 + sin(16)^2 / 2) = 0.998 of the radius.
    assert wrong[0] > 1000
    assert wrong[1] < wrong[0] / 3
    assert wrong[2] < wrong[0] / 8


def test_samples_lie_where_the_curved_surface_is_seen():
    scene = icosphere()
    seen = um.sample_tessellated(scene, FRONT, 7)
    own, (u, v) = seen.triangle[seen.covered], seen.barycentric[seen.covered].astype(np.float64).T
    corners, normals = (part[scene.triangles[own]].astype(np.float64) for part in (scene.positions, scene.normals))
    points = phong(corners, normals, np.stack([1 - u - v, u, v], axis=1))
    x, y, w = FRONT.world_to_clip @ np.column_stack([points, np.ones(len(points))]).T
    row, column = np.nonzero(seen.covered)
    off = np.hypot((x / w + 1) * 100 - 0.5 - column, (1 - y / w) * 100 - 0.5 - row)
    # A side is 0.62 long and bulges by 0.05; a seventh of it by a 49th of that, of which a unit spans 92 pixels.
    assert off.max() < 0.12


@pytest.mark.parametrize("samples_per_pixel", [1, 3])
def test_samples_are_those_of_the_mesh(samples_per_pixel):
    scene = creased(2)
    coarse, one = um.sample(scene, FRONT, samples_per_pixel), um.sample_tessellated(scene, FRONT, 1, samples_per_pixel)
    for name in ("triangle", "barycentric", "side", "position", "covered"):
        np.testing.assert_array_equal(getattr(one, name), getattr(coarse, name))
    assert one.depth is None and one.camera is FRONT

    seen = um.sample_tessellated(scene, FRONT, 7, samples_per_pixel)
    seen.check(scene)
    steps = seen.barycentric.astype(np.float64) * 2.0**24
    assert (steps == np.round(steps)).all() and (steps >= 0).all() and (steps.sum(axis=-1) <= 2**24).all()
    assert not np.array_equal(seen.covered, coarse.covered)
    light = um.Light.point((3, 4, 2))
    truth = um.shadow(scene, light, seen, "oracle").in_shadow
    assert 0 < truth.sum() < seen.covered.sum()
    np.testing.assert_array_equal(um.shadow(scene, light, seen).in_shadow, truth)


@pytest.mark.parametrize("normals", [False, True])
def test_flat_meshes_stay_as_they_are(normals):
    build = Builder([SOLID])
    build.box((-1, -1.1, -0.9), (0.3, 1, 0.7), "solid")
    build.quad([(-2, -1, 2), (2, -1, 2), (2, -1, -2), (-2, -1, -2)], "solid")
    scene = build.scene()
    if not normals:
        scene = um.Scene(scene.positions, scene.triangles)
    fine = tessellate(scene.positions, scene.triangles, scene.normals, 6)
    np.testing.assert_array_equal(fine.triangles, scene.triangles)
    np.testing.assert_array_equal(fine.positions, scene.positions)
    coarse, seen = (um.render(scene, FRONT, method="oracle", smooth_outlines=level) for level in (1, 6))
    np.testing.assert_array_equal(coarse.pixels, seen.pixels)
    np.testing.assert_array_equal(coarse.samples.barycentric, seen.samples.barycentric)


def test_render_smooths_what_is_seen_and_no_shadow():
    ball, floor = icosphere(), [(-9, -2, 9), (9, -2, 9), (0, -2, -20)]
    scene = um.Scene(
        np.concatenate([ball.positions, floor]).astype(np.float32),
        np.concatenate([ball.triangles, [(240, 241, 242)]]),
        normals=np.concatenate([ball.normals, [(0, 1, 0)] * 3]),
    )
    camera = um.Camera.look_at((0, 3, 6), (0, -1, 0), fov_y=50, width=160, height=120)
    sun = um.Light.sun(120, 50)
    coarse, smooth = (um.render(scene, camera, sun, smooth_outlines=level) for level in (1, 8))
    assert smooth.samples.depth is None
    floor_seen = (coarse.samples.triangle == 80) & (smooth.samples.triangle == 80)
    np.testing.assert_array_equal(smooth.masks[0].in_shadow[floor_seen], coarse.masks[0].in_shadow[floor_seen])
    assert coarse.masks[0].in_shadow[floor_seen].any()
    assert (smooth.samples.triangle < 80).sum() > (coarse.samples.triangle < 80).sum() + 50


def test_what_does_not_go_together_is_refused():
    scene = drum()
    for level in (0, 65, -3):
        with pytest.raises(um.OptionError, match=f"smooth outlines: wanted a level of 1 to 64, got {level}"):
            um.sample_tessellated(scene, FRONT, level)
    with pytest.raises(um.InputError, match=r"smooth outlines: wanted a whole number, got 2\.5"):
        um.render(scene, FRONT, smooth_outlines=2.5)
    with pytest.raises(um.OptionError, match="do not go with antialiasing 'derivative'"):
        um.render(scene, FRONT, smooth_outlines=2, antialiasing="derivative")
    with pytest.raises(um.OptionError, match="do not go with a stochastic picture"):
        um.render(scene, FRONT, smooth_outlines=2, stochastic=1, samples_per_pixel=4)
    glass = um.Scene(scene.positions, scene.triangles, [um.Material(alpha_mode="BLEND", transmission=0.5)])
    with pytest.raises(um.InputError, match="wanted a scene of solid surfaces"):
        um.render(glass, FRONT, smooth_outlines=2)


def test_frustums_on_opengl_take_them(opengl):
    scene, light = creased(3), um.Light.point((3, 4, 2))
    seen = um.sample_tessellated(scene, FRONT, 4)
    truth = um.shadow(scene, light, seen, "oracle").in_shadow
    assert 0 < truth.sum() < seen.covered.sum()
    np.testing.assert_array_equal(um.shadow(scene, light, seen, "frustum-gl").in_shadow, truth)


@pytest.mark.parametrize("method", ["silhouette-cpu", "smooth-gl"])
def test_volumes_refuse_samples_off_their_pixels(method, opengl):
    with pytest.raises(um.OptionError, match=f"smooth outlines: method {method} counts along view rays"):
        um.render(drum(), FRONT, method=method, smooth_outlines=2)
    with pytest.raises(um.InputError, match=f"{method}: wanted the samples of a whole picture"):
        um.shadow(drum(), um.Light.sun(200, 40), um.sample_tessellated(drum(), FRONT, 2), method)


def egg() -> um.Scene:
    """A coarse ellipsoid with its own normals."""
    ball, radii = sphere(segments=8, rings=5), (1, 1.8, 0.6)
    return um.Scene(ball.positions * radii, ball.triangles, normals=ball.normals / radii)


def kinks(silhouette: str) -> np.ndarray:
    """Degrees by which an egg's contour turns at each joint, seen from the light."""
    light = um.Light.directional((1, -0.4, 0.5))
    method = um.METHODS["smooth"](silhouette=silhouette)
    bounds = method.prepare(egg()).silhouettes.surface(light, um.ViewSamples.points([(0, 0, 0)])).bounds
    towards = light.position[:3].astype(np.float64)
    turns = []
    for joint in np.unique(bounds.ends):
        leaving, arriving = (bounds.ends[:, end] == joint for end in range(2))
        along = np.concatenate([bounds.curves.t0[leaving], -bounds.curves.t1[arriving]])
        assert len(along) == 2
        along -= (along @ towards)[:, None] * towards / (towards @ towards)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        turns.append(180 - np.degrees(np.arccos(np.clip(along[0] @ along[1], -1, 1))))
    return np.array(turns)


def test_phong_curves_leave_kinks():
    accurate, blended, smooth = (kinks(silhouette) for silhouette in ("accurate", "phong", "smooth"))
    assert len(accurate) == len(blended) == len(smooth) > 10
    assert accurate.max() > 40
    assert 8 < blended.max() < 12
    assert smooth.max() < 1e-3
