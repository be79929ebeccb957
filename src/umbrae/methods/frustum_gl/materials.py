"""What casters let through, as `gl/include/transmission.glsl` reads it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.texture import SRGB_TO_LINEAR
from umbrae.transmission import Transmission

SURFACES, MATERIALS, UVS, COLORS, TEXELS = range(16, 21)
"""Where the shaders find the arrays."""
_ROW = 16


def material_arrays(table: Transmission) -> dict[int, NDArray[Any]]:
    """The table's arrays, by the binding of the buffer that is to hold them."""
    count = len(table.closed)
    rows = np.zeros((count, _ROW))
    rows[:, 0:4], rows[:, 4], rows[:, 5] = table.base, table.transmitted, table.cutoff
    rows[:, 6] = table.mode
    rows[:, 7] = np.where(table.offset < 0, -1, table.offset // 4)
    rows[:, 8:10] = table.size
    rows[:, 10:13] = table.even
    return {
        SURFACES: 4 * table.material_id + table.kind.astype(np.int32),
        MATERIALS: np.concatenate([SRGB_TO_LINEAR.astype(np.float64), rows.reshape(-1)]),
        UVS: table.uv,
        COLORS: table.colors,
        TEXELS: table.texels,
    }
