"""Towns of boxes, where most casters are hidden or out of view."""

import numpy as np
from numpy.typing import NDArray

from umbrae import Scene

_QUADS = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
TRIANGLES = np.array([t for a, b, c, d in _QUADS for t in ((a, b, c), (a, c, d))], np.int32)


def boxes(lower: NDArray[np.floating], upper: NDArray[np.floating]) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Corners `(8 n, 3)` and triangles `(12 n, 3)` of boxes `(n, 3)`."""
    high = np.array([[k >> axis & 1 for axis in range(3)] for k in range(8)], bool)
    corners = np.where(high, np.asarray(upper)[:, None], np.asarray(lower)[:, None]).astype(np.float64)
    triangles = TRIANGLES + 8 * np.arange(len(corners), dtype=np.int32)[:, None, None]
    return corners.reshape(-1, 3), triangles.reshape(-1, 3)


def scene_of(lower: NDArray[np.floating], upper: NDArray[np.floating], ground: float | None = 0.0) -> Scene:
    """Boxes, an object each, on a square of ground at that height, which is one more object."""
    corners, triangles = boxes(lower, upper)
    object_id = np.repeat(np.arange(len(lower)), 12)
    if ground is not None:
        reach = 2.0 * float(np.abs(corners).max())
        square = [(-reach, ground, -reach), (reach, ground, -reach), (reach, ground, reach), (-reach, ground, reach)]
        triangles = np.concatenate([triangles, np.array([(0, 1, 2), (0, 2, 3)], np.int32) + len(corners)])
        corners, object_id = np.concatenate([corners, square]), np.append(object_id, [len(lower)] * 2)
    return Scene(corners.astype(np.float32), triangles, object_id=object_id)


def town(count: int, seed: int = 0) -> Scene:
    """`count` x `count` houses that stand on the ground, 10 wide, with streets of 4 between them; y is up."""
    rng = np.random.default_rng(seed)
    x, z = np.meshgrid(*2 * [14.0 * (np.arange(count) - count / 2)], indexing="ij")
    lower = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(-1, 3)
    upper = lower + np.stack([np.full(count**2, 10.0), rng.uniform(6, 30, count**2), np.full(count**2, 10.0)], axis=-1)
    return scene_of(lower, upper)
