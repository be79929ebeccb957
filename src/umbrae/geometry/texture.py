"""All textures of a scene in one flat array, and the bilinear look-up that kernels call."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.parallel import inline


def _srgb_to_linear() -> NDArray[np.float32]:
    coded = np.arange(256) / 255.0
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    return linear.astype(np.float32)


SRGB_TO_LINEAR = _srgb_to_linear()
"""`(256,)` float32: linear light of an 8-bit sRGB value (IEC 61966-2-1)."""


class Textures(NamedTuple):
    """Textures behind one another; a kernel takes the three arrays as arguments.

    Attributes
    ----------
    texels
        `(n,) uint8`, red, green, blue, alpha of all texels, row by row from the top, texture after texture.
    offset
        `(m,) int64`, where in `texels` a texture begins; -1 where there is none.
    size
        `(m, 2) int64`, height and width in texels; 0 where there is none.
    """

    texels: NDArray[np.uint8]
    offset: NDArray[np.int64]
    size: NDArray[np.int64]


def pack(textures: Sequence[NDArray[np.uint8] | None]) -> Textures:
    """Lay `(h, w, 4) uint8` textures behind one another, a slot for each; the same array is stored once."""
    offset = np.full(len(textures), -1, np.int64)
    size = np.zeros((len(textures), 2), np.int64)
    begin: dict[int, int] = {}
    blocks: list[NDArray[np.uint8]] = []
    total = 0
    for slot, texture in enumerate(textures):
        if texture is None:
            continue
        if id(texture) not in begin:
            begin[id(texture)] = total
            blocks.append(texture.reshape(-1))
            total += texture.size
        offset[slot] = begin[id(texture)]
        size[slot] = texture.shape[:2]
    texels = np.concatenate(blocks) if blocks else np.zeros(0, np.uint8)
    return Textures(texels, offset, size)


@inline
def fetch(
    texels: NDArray[np.uint8],
    offset: NDArray[np.int64],
    size: NDArray[np.int64],
    slot: int,
    u: float,
    v: float,
) -> tuple[float, float, float, float]:
    """Linear red, green, blue and alpha of texture `slot` at (u, v): bilinear, repeated outside [0, 1].

    (0, 0) is the top left corner of the image. An empty slot gives four ones. The first three arguments are
    those of `Textures`; the result is four float64.
    """
    start = offset[slot]
    if start < 0:
        return 1.0, 1.0, 1.0, 1.0
    height, width = size[slot, 0], size[slot, 1]
    x = (u - np.floor(u)) * width - 0.5
    y = (v - np.floor(v)) * height - 0.5
    left, top = int(np.floor(x)), int(np.floor(y))
    x -= left
    y -= top
    # x lies in [-0.5, width - 0.5], so left is -1 to width - 1 and one step of wrapping is enough.
    right = left + 1 if left + 1 < width else 0
    bottom = top + 1 if top + 1 < height else 0
    if left < 0:
        left = width - 1
    if top < 0:
        top = height - 1
    top_left = start + 4 * (top * width + left)
    top_right = start + 4 * (top * width + right)
    bottom_left = start + 4 * (bottom * width + left)
    bottom_right = start + 4 * (bottom * width + right)
    w00, w01, w10, w11 = (1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y
    red = (
        w00 * SRGB_TO_LINEAR[texels[top_left]]
        + w01 * SRGB_TO_LINEAR[texels[top_right]]
        + w10 * SRGB_TO_LINEAR[texels[bottom_left]]
        + w11 * SRGB_TO_LINEAR[texels[bottom_right]]
    )
    green = (
        w00 * SRGB_TO_LINEAR[texels[top_left + 1]]
        + w01 * SRGB_TO_LINEAR[texels[top_right + 1]]
        + w10 * SRGB_TO_LINEAR[texels[bottom_left + 1]]
        + w11 * SRGB_TO_LINEAR[texels[bottom_right + 1]]
    )
    blue = (
        w00 * SRGB_TO_LINEAR[texels[top_left + 2]]
        + w01 * SRGB_TO_LINEAR[texels[top_right + 2]]
        + w10 * SRGB_TO_LINEAR[texels[bottom_left + 2]]
        + w11 * SRGB_TO_LINEAR[texels[bottom_right + 2]]
    )
    alpha = (
        w00 * texels[top_left + 3]
        + w01 * texels[top_right + 3]
        + w10 * texels[bottom_left + 3]
        + w11 * texels[bottom_right + 3]
    ) / 255.0
    return red, green, blue, alpha
