"""Samples as a tree of tiles, 32 children each: what `gl/include/tiles.glsl` asks for."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

BRANCH = 3
"""Level of the nodes that tasks begin at; also in `traversal.glsl`."""
MAX_LEVELS = 9
"""Also in `tiles.glsl`: eight of them cover more than a million samples a side."""

PICTURE = ((2, 3), (3, 2))
"""How children lie side by side and one above the other, as powers of two, at even levels and at odd ones: 4 x 8 and
8 x 4 in turns (Sintorn et al. 2011, section 3.4)."""
LIST = ((5, 0), (5, 0))
"""A list is a picture of one row: 32 children that follow each other."""


class Tiles(NamedTuple):
    """Levels of nodes over samples; level 0 are these, the last level is the root.

    Attributes
    ----------
    levels
        `(n, 4) int32`: width and height of each level in nodes, its first word, the first place of its nodes.
    depth
        Level of the root.
    bits
        `PICTURE` or `LIST`.
    pixels
        Width of the picture, samples per pixel, and how many of these lie side by side and one above the other.
    words
        Number of words: one of 32 bits for each node, and so for its children.
    nodes
        Number of places for nodes above level 0: 32 for each node of the next level.
    places
        Number of places for samples.
    """

    levels: NDArray[np.int32]
    depth: int
    bits: tuple[tuple[int, int], tuple[int, int]]
    pixels: tuple[int, int, int, int]
    words: int
    nodes: int
    places: int

    def count(self, level: int) -> int:
        """Number of nodes at a level."""
        return int(self.levels[level, 0]) * int(self.levels[level, 1])

    @property
    def uniforms(self) -> dict[str, Any]:
        """For shaders that include `tiles.glsl`."""
        levels = [tuple(row) for row in self.levels.tolist()]
        return {"levels": levels, "depth": self.depth, "tile_bits": list(self.bits), "pixels": self.pixels}


def tiles_of(width: int, height: int, per_pixel: int) -> Tiles:
    """The tree over `height` rows of `width` pixels with `per_pixel` samples each, taken as one large picture."""
    across = next(n for n in range(per_pixel, 0, -1) if per_pixel % n == 0 and n * n <= per_pixel)
    down = per_pixel // across
    return _tree(width * across, height * down, (width, per_pixel, across, down), PICTURE)


def tiles_of_list(count: int) -> Tiles:
    """The tree over `count` samples that follow each other."""
    return _tree(count, 1, (count, 1, 1, 1), LIST)


def _tree(
    width: int, height: int, pixels: tuple[int, int, int, int], bits: tuple[tuple[int, int], tuple[int, int]]
) -> Tiles:
    def shape(level: int) -> tuple[int, int]:
        across, down = bits[level % 2]
        return 1 << across, 1 << down

    rows = [(width, height, 0, 0)]
    words = nodes = 0
    while rows[-1][0] * rows[-1][1] > 1 or len(rows) == 1:
        level = len(rows)
        size, above = shape(level), shape(level + 1)
        columns, lines = -(-rows[-1][0] // size[0]), -(-rows[-1][1] // size[1])
        rows.append((columns, lines, words, nodes))
        words += columns * lines
        nodes += 32 * -(-columns // above[0]) * -(-lines // above[1])
    levels = np.zeros((MAX_LEVELS, 4), np.int32)
    levels[: len(rows)] = rows
    places = 32 * rows[1][0] * rows[1][1]
    return Tiles(levels, len(rows) - 1, bits, pixels, words, nodes, places)
