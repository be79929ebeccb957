"""Surfaces that are not there everywhere: holes of alpha mode MASK, and of BLEND where nothing is left."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.scene import Scene
from umbrae.transmission import BLEND, CLEAR, EVEN, MASK, OPAQUE, VARYING, Transmission, transmission_of

NOWHERE, SOMEWHERE, EVERYWHERE = range(3)
"""Where a triangle has holes."""

NOTHING = 0.5 / 255
"""Opacity below which there is nothing to be seen: it rounds to 0 in 8 bits."""


class Surface(NamedTuple):
    """What decides whether a sample sees through a triangle.

    Attributes
    ----------
    holes
        `(t,) uint8`: `NOWHERE`, `SOMEWHERE` or `EVERYWHERE`.
    table
        What triangles let through; of a scene that is solid, one without rows.
    """

    holes: NDArray[np.uint8]
    table: Transmission


def surface_of(scene: Scene) -> Surface:
    """A scene's surface as kernels want it.

    Holes of alpha mode MASK are those that the scene's shadows have: the same function decides, at the same point.

    Raises
    ------
    InputError
        When a texture decides, and the scene has no texture coordinates.
    """
    holes = np.full(len(scene.triangles), NOWHERE, np.uint8)
    table = transmission_of(scene)
    if table is None:
        return Surface(holes, _without_rows(scene.material_id[:0]))
    mode = table.mode[scene.material_id]
    asks = (mode == MASK) & (table.kind == VARYING)
    asks |= (mode == BLEND) & ((table.kind == VARYING) | (table.kind == EVEN))
    holes[asks] = SOMEWHERE
    # What lets everything through is not there at all, or is perfectly clear glass, which may have holes.
    clear = (mode != OPAQUE) & (table.kind == CLEAR)
    holes[clear] = np.where(table.transmitted[scene.material_id[clear]] == 1.0, SOMEWHERE, EVERYWHERE)
    return Surface(holes, table)


def _without_rows(none: NDArray[np.int32]) -> Transmission:
    """A table of the same types; to Numba it is one of them that an array cannot be written to."""
    numbers, rows, colors = np.zeros(0), np.zeros((0, 2), np.float32), np.zeros((0, 4), np.float32)
    for array in (none, rows, colors):
        array.flags.writeable = False
    return Transmission(
        kind=np.zeros(0, np.uint8),
        material_id=none,
        closed=np.zeros(0, bool),
        even=np.zeros((0, 3)),
        base=np.zeros((0, 4)),
        transmitted=numbers,
        cutoff=numbers,
        mode=np.zeros(0, np.int8),
        uv=rows,
        colors=colors,
        texels=np.zeros(0, np.uint8),
        offset=np.zeros(0, np.int64),
        size=np.zeros((0, 2), np.int64),
    )
