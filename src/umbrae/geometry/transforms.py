"""Affine maps: `(..., 4, 4)` matrices that are multiplied with columns."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def composed(translation: Floats, rotation: Floats, scale: Floats) -> Floats:
    """`(..., 4, 4)`: scaled first, then rotated by a quaternion `(..., 4)` x, y, z, w of any length, then moved."""
    x, y, z, w = np.moveaxis(rotation, -1, 0)
    length = x * x + y * y + z * z + w * w
    s = np.where(length > 0, 2 / np.where(length > 0, length, 1.0), 0.0)
    turned = [
        [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
        [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
        [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
    ]
    matrix = np.zeros((*length.shape, 4, 4))
    matrix[..., :3, :3] = np.moveaxis(np.array(turned), (0, 1), (-2, -1)) * scale[..., None, :]
    matrix[..., :3, 3] = translation
    matrix[..., 3, 3] = 1.0
    return matrix


def turning(axis: Floats, degrees: float) -> Floats:
    """`(3, 3)`: around an axis of length 1, counter-clockwise where it comes towards one."""
    x, y, z = axis
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = np.radians(degrees)
    matrix: Floats = np.eye(3) + np.sin(angle) * across + (1.0 - np.cos(angle)) * (across @ across)
    return matrix


def transformed(positions: Floats, normals: Floats | None, matrix: Floats) -> tuple[Floats, Floats | None]:
    """Positions and normals `(n, 3)` under one matrix `(4, 4)`, or one each `(n, 4, 4)`.

    Normals keep to the outer side under a mirror image, and are of length 1, or 0 where the map flattens them.
    """
    if np.array_equal(matrix, np.eye(4)):
        return positions, normals  # adding 0.0 would still turn -0.0 into 0.0
    linear, shift = matrix[..., :3, :3], matrix[..., :3, 3]
    placed = _applied(linear, positions) + shift
    if normals is None:
        return placed, None
    outwards = np.where(np.linalg.det(linear) < 0, -1.0, 1.0)
    turned = _applied(outwards[..., None, None] * _cofactors(linear), normals)
    lengths = np.linalg.norm(turned, axis=1, keepdims=True)
    return placed, np.divide(turned, lengths, out=np.zeros_like(turned), where=lengths > 0)


def _applied(linear: Floats, rows: Floats) -> Floats:
    product: Floats = rows @ linear.T if linear.ndim == 2 else np.einsum("nij,nj->ni", linear, rows)
    return product


def _cofactors(m: Floats) -> Floats:
    """`det(m) * inverse(m).T`, which also exists for a matrix that flattens."""
    a, b, c = m[..., 0, :], m[..., 1, :], m[..., 2, :]
    return np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=-2)
