"""View samples in lists, one for each cell of a grid over a light frame: an alias-free shadow map before it is drawn.

Which cell a sample goes to may be off by rounding. What counts is where it really lies, and that is what leaves of 16
know (see `sample_clusters`): a leaf that reaches out of its cell by at most `margin` stays there, and triangles look
so much farther around. One that reaches out by half a cell or more goes to the frame's last list, which every triangle
asks: samples so near to a point light that their direction is unsure.
"""

from itertools import count
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.methods.counting_sort import sort_by_key
from umbrae.methods.lanes import LANES
from umbrae.methods.light_frame import LightFrame
from umbrae.methods.sample_cells import NOT_ASKED, file_leaves, find_cells, place_samples
from umbrae.methods.sample_clusters import SPARE, cluster_tiles
from umbrae.methods.sample_tree import Leaves
from umbrae.parallel import run
from umbrae.samples import ViewSamples

_SAMPLES_PER_TASK = 65536
_TILES_PER_TASK = 1024
_REGION = 4096


class Grid(NamedTuple):
    """The cells over one light frame, as plain numbers for kernels.

    Cell (i, j) covers i to i + 1 of (x - x0) * scale_x, and so on, in window units; its list is number
    `first + j * cells + i`. The list after the last cell's is for leaves that fit into none. No other leaf reaches
    farther out of its cell than `margin`.
    """

    first: int
    cells: int
    x0: float
    y0: float
    scale_x: float
    scale_y: float
    margin: float

    @property
    def rest(self) -> "Grid":
        """A single cell that all triangles meet: the frame's last list."""
        return Grid(self.first + self.cells * self.cells, 1, 0.0, 0.0, 0.0, 0.0, 0.0)


class SampleLists(NamedTuple):
    """Leaves by cells.

    `slots` `(n,)` rows of `leaves`, list k in `slots[ends[k]:ends[k + 1]]`; `nearest` `(lists,)` the least q in each;
    `full` `(lists,)` and `dark` `(slots of leaves,)` are set when all of a list, or of a leaf, is in shadow.
    """

    slots: NDArray[np.int32]
    ends: NDArray[np.int32]
    nearest: NDArray[np.float32]
    full: NDArray[np.uint8]
    dark: NDArray[np.uint8]

    def has(self, grid: Grid) -> bool:
        """Whether any leaf lies in the cells of a grid."""
        return bool(self.ends[grid.first] < self.ends[grid.first + grid.cells * grid.cells])

    @property
    def bytes(self) -> int:
        """Of all arrays."""
        total: int = sum(part.nbytes for part in self)
        return total


def build(
    samples: ViewSamples,
    facing: NDArray[np.int8],
    light: NDArray[np.float64],
    frames: list[LightFrame],
    limits: tuple[float, float],
    cells: int,
    in_shadow: NDArray[np.bool_],
) -> tuple[Leaves, SampleLists, list[Grid]]:
    """Put the covered samples into lists, `cells` x `cells` of them for each frame that has samples.

    Samples that their own triangle shades are set in `in_shadow` (flat) and left out. `facing` and `limits` are those
    of `sample_tree.build`. Frames without samples get a grid without cells.
    """
    table = np.array([frame.row() for frame in frames])
    raw = samples.triangle.reshape(-1), samples.side.reshape(-1), samples.position.reshape(-1, 3)
    covered = samples.covered.reshape(-1)
    place, frame_of = np.empty((samples.size, 2), np.float32), np.empty(samples.size, np.int8)

    def look(task: int) -> NDArray[np.float64]:
        start, stop = task * _SAMPLES_PER_TASK, min((task + 1) * _SAMPLES_PER_TASK, samples.size)
        bounds = np.full((len(frames), 4), np.inf)
        place_samples(*raw, covered, facing, light, table, start, stop, place, frame_of, bounds, in_shadow)
        return bounds

    tasks = -(-samples.size // _SAMPLES_PER_TASK)
    bounds = np.min([np.full((len(frames), 4), np.inf), *run(look, tasks)], axis=0)
    grids = [_grid(number, cells, *bounds[number]) for number in range(len(frames))]
    order = _by_cells(frame_of, place, grids, cells)
    leaves, used = _leaves((*raw, covered), facing, light, table, limits, order, in_shadow)
    return leaves, *_file(leaves, used, grids, cells)


def _grid(number: int, cells: int, x0: float, x1: float, y0: float, y1: float) -> Grid:
    """A grid over x from x0 to -x1, y from y0 to -y1."""
    first = number * (cells * cells + 1)
    if x0 == np.inf:
        return Grid(first, cells, 0.0, 0.0, 0.0, 0.0, 0.0)
    width, height = (max(-high - low, 2.0**-20) for low, high in ((x0, x1), (y0, y1)))
    return Grid(first, cells, x0, y0, cells / width, cells / height, 0.0)


def _by_cells(
    frame_of: NDArray[np.int8], place: NDArray[np.float32], grids: list[Grid], cells: int
) -> NDArray[np.int32]:
    """The samples that are asked, cell by cell, each cell padded with -1 to whole leaves."""
    asked = np.flatnonzero(frame_of != NOT_ASKED).astype(np.int32)
    lists = len(grids) * (cells * cells + 1)
    keys, ends = np.empty(len(frame_of), np.int32), np.zeros(lists + 1, np.int32)
    table = np.array([grid[:6] for grid in grids])

    def find(task: int) -> None:
        start, stop = task * _SAMPLES_PER_TASK, min((task + 1) * _SAMPLES_PER_TASK, len(frame_of))
        find_cells(frame_of, place, table, start, stop, keys)

    run(find, -(-len(frame_of) // _SAMPLES_PER_TASK))
    by_cells = np.empty(len(asked), np.int32)
    sort_by_key(asked, keys, 0, by_cells, ends)
    lengths = np.diff(ends)
    padded = -(-lengths // LANES) * LANES
    starts = np.cumsum(padded) - padded
    order = np.full(int(padded.sum()), -1, np.int32)
    order[np.repeat(starts - ends[:-1], lengths) + np.arange(len(asked))] = by_cells
    return order


def _leaves(
    raw: tuple[NDArray[np.int32], NDArray[np.int8], NDArray[np.float32], NDArray[np.bool_]],
    facing: NDArray[np.int8],
    light: NDArray[np.float64],
    table: NDArray[np.float64],
    limits: tuple[float, float],
    order: NDArray[np.int32],
    in_shadow: NDArray[np.bool_],
) -> tuple[Leaves, NDArray[np.int32]]:
    """Sixteen by sixteen, and the rows that are used. Only those take memory, whatever is reserved."""
    tiles, room = len(order) // LANES, len(table) + SPARE
    tasks = -(-tiles // _TILES_PER_TASK)
    slots = (-(-tiles * room // (_REGION - room)) + tasks + 1) * _REGION
    leaves = Leaves(
        place=np.empty((slots, 3 * LANES), np.float32),
        ids=np.empty((slots, 2 * LANES), np.int32),
        box=np.empty((slots, 8), np.float32),
        key=np.empty(slots, np.int64),
    )
    regions = count(0, _REGION)

    def task(number: int) -> list[NDArray[np.int32]]:
        tile, stop = number * _TILES_PER_TASK, min((number + 1) * _TILES_PER_TASK, tiles)
        used, slot, last = [], 0, 0
        while tile < stop:
            if slot + room > last:
                slot = next(regions)
                last = slot + _REGION
            first = slot
            slot, tile = cluster_tiles(
                *raw, facing, light, table, *limits, np.float32(np.inf), 1, len(in_shadow), order, tile, stop, slot,
                last, *leaves, in_shadow,
            )  # fmt: skip
            used.append(np.arange(first, slot, dtype=np.int32))
        return used

    parts = [part for parts in run(task, tasks) for part in parts]
    return leaves, np.concatenate([np.zeros(0, np.int32), *parts])


def _file(leaves: Leaves, used: NDArray[np.int32], grids: list[Grid], cells: int) -> tuple[SampleLists, list[Grid]]:
    """The leaves by the cells they lie in, and the grids with their margins."""
    lists = len(grids) * (cells * cells + 1)
    rows = int(used.max(initial=-1)) + 1
    key, margins = np.empty(rows, np.int32), np.zeros(len(grids))
    nearest = np.full(lists, np.inf, np.float32)
    file_leaves(used, leaves.box, leaves.key, np.array([grid[:6] for grid in grids]), key, margins, nearest)
    slots, ends = np.empty(len(used), np.int32), np.zeros(lists + 1, np.int32)
    sort_by_key(used, key, 0, slots, ends)
    found = SampleLists(slots, ends, nearest, np.zeros(lists, np.uint8), np.zeros(rows, np.uint8))
    return found, [grid._replace(margin=float(margin)) for grid, margin in zip(grids, margins, strict=True)]
