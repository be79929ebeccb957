"""The points that want a verdict."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbrae.camera import Camera
from umbrae.checks import array, instance
from umbrae.errors import InputError
from umbrae.geometry.morton import morton3
from umbrae.scene import Scene


@dataclass(frozen=True, eq=False)
class ViewSamples:
    """Points with any leading shape `(...)`: an image `(h, w)`, a supersampled one `(h, w, s)`, a list `(n,)`.

    A sample on a surface *is* the point `A + u (B - A) + v (C - A)` of its triangle in exact arithmetic, lying
    infinitesimally off the triangle on the side it is seen from. A free point is its float32 position.

    Attributes
    ----------
    triangle
        `(...) int32`, own triangle; -1 for a free point or background.
    barycentric
        `(..., 2) float32`, u and v; `u, v >= 0` and `u + v <= 1` exactly.
    side
        `(...) int8`: +1 seen from the side its winding turns counter-clockwise to, -1 from the other,
        0: the own triangle is ignored.
    position
        `(..., 3) float32` world units, the point rounded.
    covered
        `(...) bool`, false for background.
    depth
        `(...) float32` distance along the view direction in world units, infinite for background; images only.
    camera
        The camera of an image.
    throughput
        `(..., 3) float32`, of an image sampled stochastically: what the light that is shed at a sample counts, per
        colour channel, so that on average a pixel's samples see what lies behind transparent surfaces.
    looks_through
        Whether surfaces of the scene may lie between the eye and the samples of an image: it lets light through.
    """

    triangle: NDArray[np.int32]
    barycentric: NDArray[np.float32]
    side: NDArray[np.int8]
    position: NDArray[np.float32]
    covered: NDArray[np.bool_]
    depth: NDArray[np.float32] | None = None
    camera: Camera | None = None
    throughput: NDArray[np.float32] | None = None
    looks_through: bool = False

    def __post_init__(self) -> None:
        instance(self.triangle, np.ndarray, "ViewSamples.triangle")
        shape = self.triangle.shape
        if not shape:
            raise InputError("ViewSamples: wanted a list of samples, got a single one without brackets around it")
        for name, wanted, dtype in (
            ("triangle", shape, np.int32),
            ("barycentric", (*shape, 2), np.float32),
            ("side", shape, np.int8),
            ("position", (*shape, 3), np.float32),
            ("covered", shape, np.bool_),
        ):
            values = getattr(self, name)
            instance(values, np.ndarray, f"ViewSamples.{name}")
            if values.shape != wanted or values.dtype != dtype:
                raise InputError(
                    f"ViewSamples.{name}: wanted {wanted} {np.dtype(dtype)}, got {values.shape} {values.dtype}"
                )

    @property
    def shape(self) -> tuple[int, ...]:
        """Leading shape of all arrays."""
        return self.triangle.shape

    @property
    def size(self) -> int:
        """Number of samples."""
        return self.triangle.size

    @classmethod
    def points(cls, positions: ArrayLike) -> "ViewSamples":
        """Free points `(..., 3)` in the scene's coordinates, rounded to float32: they belong to no triangle."""
        given = array(positions, "ViewSamples.points")
        if given.shape == (0,):
            given = np.zeros((0, 3))
        if given.ndim == 0 or given.shape[-1] != 3 or given.dtype.kind not in "iuf":
            raise InputError(f"ViewSamples.points: wanted (..., 3) coordinates, got {given.shape} {given.dtype}")
        if not (np.abs(given) <= 1e18).all():
            raise InputError("ViewSamples.points: wanted finite coordinates up to 1e18")
        points = given.astype(np.float32)
        shape = points.shape[:-1]
        return cls(
            triangle=np.full(shape, -1, np.int32),
            barycentric=np.zeros((*shape, 2), np.float32),
            side=np.zeros(shape, np.int8),
            position=np.ascontiguousarray(points),
            covered=np.ones(shape, bool),
        )

    @classmethod
    def on_surface(
        cls, scene: Scene, triangle: ArrayLike, barycentric: ArrayLike, side: ArrayLike = 1
    ) -> "ViewSamples":
        """Sensors on faces: `triangle (...)`, `barycentric (..., 2)`, `side` +1, -1 or 0 (one or one each).

        Barycentrics are rounded to float32, towards the inside where their sum would exceed 1.

        Raises
        ------
        InputError
            For a triangle that the scene does not have, or barycentrics outside the triangle.
        """
        instance(scene, Scene, "scene")
        own = array(triangle, "ViewSamples.on_surface: triangle")
        if not np.issubdtype(own.dtype, np.integer) and own.size:
            raise InputError(f"ViewSamples.on_surface: wanted triangle indices, got {own.dtype}")
        uv = array(barycentric, "ViewSamples.on_surface: barycentric")
        count = len(scene.triangles)
        if own.size and (own.min() < 0 or own.max() >= count):
            raise InputError(
                f"ViewSamples.on_surface: wanted triangles 0 to {count - 1}, got {int(own.min())} to {int(own.max())}"
            )
        if uv.shape != (*own.shape, 2) or uv.dtype.kind not in "iuf":
            wanted = (*own.shape, 2)
            raise InputError(f"ViewSamples.on_surface: wanted barycentrics {wanted}, got {uv.shape} {uv.dtype}")
        if not ((uv >= 0).all() and (uv.sum(axis=-1, dtype=np.float64) <= 1).all()):
            raise InputError("ViewSamples.on_surface: wanted barycentrics with u, v >= 0 and u + v <= 1")
        sides = array(side, "ViewSamples.on_surface: side")
        if sides.shape not in ((), own.shape) or not np.isin(sides, (-1, 0, 1)).all():
            raise InputError("ViewSamples.on_surface: wanted sides of +1, -1 or 0, one or one each")
        triangles, rounded = own.astype(np.int32), _round_inside(uv)
        return cls(
            triangle=triangles,
            barycentric=rounded,
            side=np.array(np.broadcast_to(sides, own.shape), np.int8),
            position=surface_positions(scene, triangles, rounded),
            covered=np.ones(own.shape, bool),
        )

    def check(self, scene: Scene) -> None:
        """Refuse samples that were not made for this scene.

        All triangle indices are checked, and of up to 64 samples the position: that costs next to nothing, and
        the samples of another scene lie somewhere else.
        """
        own, count = self.triangle.reshape(-1), len(scene.triangles)
        if own.size and not -1 <= own.min() <= own.max() < count:
            raise InputError(
                f"samples are of another scene: they name triangles {own.min()} to {own.max()}, this has {count}"
            )
        some = np.arange(0, own.size, max(1, own.size // 64))
        few = self.take(some[own[some] >= 0])
        there = surface_positions(scene, few.triangle, few.barycentric)
        # Computed in float64 by the same formula: float32 rounds the two alike or one step apart.
        reach = np.abs(scene.positions[scene.triangles[few.triangle]]).max(axis=(1, 2), initial=0)
        if not (np.abs(there - few.position).max(axis=1, initial=0) <= 2.0**-23 * reach).all():
            raise InputError("samples are of another scene: they do not lie on this scene's triangles")
        if self.camera is None and not (np.abs(self.position) <= 1e18).all():
            raise InputError("ViewSamples.position: wanted finite coordinates up to 1e18")

    @cached_property
    def along_curve(self) -> NDArray[np.intp]:
        """`(n,)` flat indices in an order in which neighbours in space follow each other."""
        return np.argsort(morton3(self.position.reshape(-1, 3).astype(np.float64)), kind="stable")

    def rows(self, start: int, stop: int) -> "ViewSamples":
        """Rows `start` to `stop` of the first axis: a band of an image, a part of a list."""
        return ViewSamples(
            triangle=self.triangle[start:stop],
            barycentric=self.barycentric[start:stop],
            side=self.side[start:stop],
            position=self.position[start:stop],
            covered=self.covered[start:stop],
            depth=None if self.depth is None else self.depth[start:stop],
            camera=self.camera,
            throughput=None if self.throughput is None else self.throughput[start:stop],
            looks_through=self.looks_through,
        )

    def take(self, index: NDArray[np.intp]) -> "ViewSamples":
        """The samples at flat indices `(n,)`, as a list."""
        return ViewSamples(
            triangle=self.triangle.reshape(-1)[index],
            barycentric=self.barycentric.reshape(-1, 2)[index],
            side=self.side.reshape(-1)[index],
            position=self.position.reshape(-1, 3)[index],
            covered=self.covered.reshape(-1)[index],
        )


def surface_positions(
    scene: Scene, triangle: NDArray[np.int32], barycentric: NDArray[np.float32]
) -> NDArray[np.float32]:
    """`A + u (B - A) + v (C - A)` in float64, rounded to float32."""
    return surface_points(scene, triangle, barycentric).astype(np.float32)


def surface_points(scene: Scene, triangle: NDArray[np.int32], barycentric: NDArray[np.float32]) -> NDArray[np.float64]:
    """`A + u (B - A) + v (C - A)` in float64."""
    corners = scene.positions[scene.triangles[triangle]].astype(np.float64)
    u, v = barycentric[..., :1].astype(np.float64), barycentric[..., 1:].astype(np.float64)
    a, b, c = corners[..., 0, :], corners[..., 1, :], corners[..., 2, :]
    points: NDArray[np.float64] = a + u * (b - a) + v * (c - a)
    return points


def _round_inside(uv: NDArray[Any]) -> NDArray[np.float32]:
    """Barycentrics as float32; where that brings the sum above 1, by 2**-24 at most, the larger takes a step back."""
    rounded = uv.astype(np.float32)
    over = np.flatnonzero(~_inside(rounded))
    pairs = rounded.reshape(-1, 2)
    larger = np.argmax(pairs[over], axis=1)
    pairs[over, larger] = np.nextafter(pairs[over, larger], np.float32(0))
    return rounded


def _inside(uv: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Whether u, v >= 0 and u + v <= 1, without rounding (two-sum of the float64 values)."""
    u, v = uv[..., 0].astype(np.float64), uv[..., 1].astype(np.float64)
    total = u + v
    part = total - u
    error = (u - (total - part)) + (v - part)
    inside: NDArray[np.bool_] = (u >= 0) & (v >= 0) & ((total < 1) | ((total == 1) & (error <= 0)))
    return inside
