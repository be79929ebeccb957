"""The points that want a verdict."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbrae.camera import Camera
from umbrae.errors import InputError
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
    """

    triangle: NDArray[np.int32]
    barycentric: NDArray[np.float32]
    side: NDArray[np.int8]
    position: NDArray[np.float32]
    covered: NDArray[np.bool_]
    depth: NDArray[np.float32] | None = None
    camera: Camera | None = None

    def __post_init__(self) -> None:
        shape = self.triangle.shape
        for name, wanted, dtype in (
            ("triangle", shape, np.int32),
            ("barycentric", (*shape, 2), np.float32),
            ("side", shape, np.int8),
            ("position", (*shape, 3), np.float32),
            ("covered", shape, np.bool_),
        ):
            array = getattr(self, name)
            if array.shape != wanted or array.dtype != dtype:
                raise InputError(
                    f"ViewSamples.{name}: wanted {wanted} {np.dtype(dtype)}, got {array.shape} {array.dtype}"
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
        points = np.asarray(positions, np.float32)
        if points.ndim == 0 or points.shape[-1] != 3:
            raise InputError(f"ViewSamples.points: wanted (..., 3) coordinates, got shape {points.shape}")
        if not np.isfinite(points).all() or (points.size and np.abs(points).max() > 1e18):
            raise InputError("ViewSamples.points: wanted finite coordinates up to 1e18")
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

        Raises
        ------
        InputError
            For a triangle that the scene does not have, or barycentrics outside the triangle.
        """
        own = np.asarray(triangle)
        if not np.issubdtype(own.dtype, np.integer) and own.size:
            raise InputError(f"ViewSamples.on_surface: wanted triangle indices, got {own.dtype}")
        own = np.array(own, np.int32)
        uv = np.array(barycentric, np.float32)
        count = len(scene.triangles)
        if own.size and (own.min() < 0 or own.max() >= count):
            raise InputError(
                f"ViewSamples.on_surface: wanted triangles 0 to {count - 1}, got {int(own.min())} to {int(own.max())}"
            )
        if uv.shape != (*own.shape, 2):
            raise InputError(f"ViewSamples.on_surface: wanted barycentrics {(*own.shape, 2)}, got {uv.shape}")
        if not _inside(uv).all():
            raise InputError("ViewSamples.on_surface: wanted barycentrics with u, v >= 0 and u + v <= 1")
        sides = np.asarray(side)
        if not np.isin(sides, (-1, 0, 1)).all():
            raise InputError("ViewSamples.on_surface: wanted sides of +1, -1 or 0")
        return cls(
            triangle=own,
            barycentric=uv,
            side=np.array(np.broadcast_to(sides, own.shape), np.int8),
            position=surface_positions(scene, own, uv),
            covered=np.ones(own.shape, bool),
        )

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
    corners = scene.positions.astype(np.float64)[scene.triangles[triangle]]
    u, v = barycentric[..., :1].astype(np.float64), barycentric[..., 1:].astype(np.float64)
    a, b, c = corners[..., 0, :], corners[..., 1, :], corners[..., 2, :]
    return (a + u * (b - a) + v * (c - a)).astype(np.float32)


def _inside(uv: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Whether u, v >= 0 and u + v <= 1, without rounding (two-sum of the float64 values)."""
    u, v = uv[..., 0].astype(np.float64), uv[..., 1].astype(np.float64)
    total = u + v
    part = total - u
    error = (u - (total - part)) + (v - part)
    inside: NDArray[np.bool_] = (u >= 0) & (v >= 0) & ((total < 1) | ((total == 1) & (error <= 0)))
    return inside
