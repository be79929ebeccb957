"""The camera and the light as shaders want them, and how far what they compute may be off."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera
from umbrae.errors import InputError
from umbrae.light import Light
from umbrae.parallel import kernel, run
from umbrae.projection import Uniforms, camera_uniforms
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

_CHUNK = 1 << 16
_FARTHEST = 2.0**100
"""Of a light, in scenes of size 1: its products with directions stay within float32."""
_LEAST_DEPTH_SCALE = 2.0**-60
"""For near planes that are nearer than float32 can tell: only ratios of depths matter."""
_LEAST_SLOPE = 2.0**-6
"""Cosine between light and far plane below which volumes go to infinity: they would not end much earlier."""
_BEYOND = 2.0**-6
"""How far behind everything the far plane lies, as a share of the scene's extent: many roundings."""


def view_uniforms(camera: Camera, light: Light, scale: float, sample: int, per_pixel: int) -> Uniforms:
    """What `camera.glsl` needs, in units of 1 / `scale`; `sample` of `per_pixel` lies off the pixels' centres."""
    position = light.position.astype(np.float64)
    position[:3] *= 2.0 ** -np.frexp(np.abs(position[:3]).max())[1] if light.is_directional else scale
    if np.abs(position).max() > _FARTHEST:
        raise InputError(
            f"light at {light.position[:3].tolist()}: too far from a scene of this size for OpenGL's float32; "
            "the method `frustum` takes it"
        )
    camera_part = camera_uniforms(camera, scale, sample, per_pixel)
    return {
        **camera_part,
        "depth_scale": max(camera_part["depth_scale"], _LEAST_DEPTH_SCALE),
        "light": tuple(position.tolist()),
        "far_plane": (0.0, 0.0, 0.0, 0.0),
        "world_scale": scale,
    }


def far_plane(scene: Scene, camera: Camera, light: Light, scale: float) -> tuple[float, float, float, float]:
    """A plane behind the scene and the eye where volumes may end, `n . p = w` in units of 1 / `scale`.

    No view ray meets a sample beyond it: nothing before a sample is lost, and what lies behind one stays closed, with
    the dark caps in the plane. Sides need not cover the picture as far as infinity. It is perpendicular to an axis, and
    all light must travel towards it, so that every vertex has its own point on it and an edge's two points have all
    between them beyond the scene as well. Zeros when there is none: a light amid the scene.
    """
    low, high = scene.bounds.astype(np.float64)
    corners = np.array([low, high])
    position = light.position.astype(np.float64)
    best, shortest = (0.0, 0.0, 0.0, 0.0), np.inf
    for axis in range(3):
        for sign in (-1.0, 1.0):
            ahead = sign * (position[3] * corners[:, axis] - position[axis])
            to_scene = np.linalg.norm(np.maximum(np.abs(low - position[:3]), np.abs(high - position[:3])))
            length = to_scene if position[3] else np.linalg.norm(position[:3])
            slope = ahead.min() / length
            if slope < _LEAST_SLOPE:
                continue
            reached = max(float((sign * corners[:, axis]).max()), sign * float(camera.eye[axis]))
            start = float((sign * corners[:, axis]).min())
            reached += _BEYOND * (reached - start) + _BEYOND * float(np.abs(high - low).max())
            if (reached - start) / slope < shortest:
                shortest = (reached - start) / slope
                # Float32 must not round it back onto the scene: 64 of its steps.
                reached += 2.0**-18 * max(1.0 / scale, abs(reached))
                x, y, z = (sign if other == axis else 0.0 for other in range(3))
                best = (x, y, z, reached * scale)
    return best


@dataclass(frozen=True)
class Rounding:
    """How far a face of a volume may be drawn from where it is: `pixel` for each unit of distance, `world`, `turned`.

    Vertices are rounded to the driver's subpixel grid: at most half a step in x and in y, which moves every point of
    a face by less than one step of the grid, at its own depth (a point of a triangle is an affine combination of its
    corners, before and after). That is `pixel_size / 2**bits` at distance 1. Depths are float32, formed by one division
    and interpolated with two products: 2**-20 of the distance has room for 8 roundings, and for what the slopes of a
    face lose over a picture of 2**12 pixels, where that is less than a step of the grid. The sample's own triangle is
    moved like any other, and with it the sample, as far along the view ray as the triangle is steep: by the distance
    across, divided by the cosine between ray and normal.

    Before that, coordinates are rounded in float32: relative to the eye (2 roundings), projected (5), clipped (3), each
    by 2**-24 of the vertex's distance from the eye. Over three axes that stays below 2**-20 of the sum of the eye's
    reach and the scene's extent, `world`. The band has it twice: once more for an eye moved off a face by as much.

    A direction away from the light is rounded once, by 2**-24 of its length, and projected. However far the light is,
    that turns a side by as much of the extent; more where it is close to an edge, by `light_spread`, since the side's
    middle is then a small difference of two directions: `turned` is 2**-22 of the extent times that.
    """

    pixel: float
    world: float
    turned: float

    @classmethod
    def of(cls, scene: Scene, camera: Camera, subpixel_bits: int, spread: float = 2.0) -> "Rounding":
        low, high = scene.bounds.astype(np.float64)
        reach = float(np.linalg.norm(np.maximum(np.abs(high - camera.eye), np.abs(low - camera.eye))))
        extent = float(np.linalg.norm(high - low))
        pixel = camera.pixel_size * 2.0**-subpixel_bits + 2.0**-20
        return cls(pixel, (reach + extent) * 2.0**-20, extent * spread * 2.0**-22)

    @property
    def box_margin(self) -> tuple[float, float]:
        """World units by which a box must be widened so that, drawn, it holds all that is drawn of its content.

        Content and box may each be off by `pixel` times the distance, `world` and `turned`. The distance is at most the
        eye's reach: what lies farther lies behind all samples. The first number is for the content and all of the box
        but `turned`, the second for that, for each unit of the spread of its own edges. Reach and extent are each less
        than 2**20 `world`.
        """
        reach = self.world * 2.0**20
        return 2.0 * self.pixel * reach + 2.0 * self.world + self.turned, reach * 2.0**-22

    def band(self, samples: ViewSamples, normals: NDArray[np.float32]) -> NDArray[np.float32]:
        """`(...)` world units, 0 for background; `normals (t, 3)` are the triangles' own, of length 1."""
        assert samples.depth is not None and samples.camera is not None
        band = np.empty(samples.size, np.float32)
        chunks = range(0, samples.size, _CHUNK)
        arrays = samples.depth.reshape(-1), samples.triangle.reshape(-1), samples.position.reshape(-1, 3)
        eye = samples.camera.eye

        def task(index: int) -> None:
            start, stop = chunks[index], min(chunks[index] + _CHUNK, samples.size)
            _band(*arrays, normals, eye, self.pixel, 2.0 * self.world + self.turned, start, stop, band)

        run(task, len(chunks))
        return band.reshape(samples.shape)


@kernel
def _band(depth, triangle, position, normals, eye, pixel, world, start, stop, band):
    for i in range(start, stop):
        t = triangle[i]
        if t < 0:
            band[i] = 0.0
            continue
        x, y, z = position[i, 0] - eye[0], position[i, 1] - eye[1], position[i, 2] - eye[2]
        along = abs(normals[t, 0] * x + normals[t, 1] * y + normals[t, 2] * z)
        steep = np.sqrt(x * x + y * y + z * z) / along if along > 0.0 else np.inf
        band[i] = depth[i] * pixel * steep + world
