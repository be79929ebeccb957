"""A town of any size: houses with balconies along straight streets, each an object, and a tree in a street."""

import math

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera
from umbrae.checks import whole
from umbrae.errors import InputError
from umbrae.light import Light
from umbrae.material import Material
from umbrae.scene import Scene

Floats = NDArray[np.float64]

LOT = 24.0
"""Distance between the middles of neighbouring houses in metres; streets take what they leave."""
MAX_TRIANGLES = 100_000_000
_BOX = 12
_COLORS = ((0.78, 0.72, 0.62), (0.70, 0.52, 0.40), (0.62, 0.60, 0.58), (0.82, 0.78, 0.66))

# Corners of a box by the bits of their index: 1 is x, 2 is y, 4 is z. Counter-clockwise seen from outside.
_FACES = np.array([(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)])


def town(grid: tuple[int, int] = (20, 20), triangles: int = 200_000, tree: int = 0, seed: int = 0) -> Scene:
    """Houses on a grid of lots over a ground of two triangles; object 0 is the ground, then come the houses.

    Parameters
    ----------
    grid
        Number of lots along x and z.
    triangles
        Number wanted in all, as near as boxes of 12 allow: houses get as many balconies each.
    tree
        Of these, how many belong to a tree in the street in the middle, the last object; none for 0.
    seed
        Of sizes, heights and colours.

    Raises
    ------
    InputError
        For a grid without lots, or fewer triangles than houses and tree take.
    """
    columns, rows = (whole(count, "town: grid") for count in grid)
    lots, trunk = columns * rows, _BOX if tree else 0
    least = 2 + _BOX * max(lots, 0) + tree
    if columns < 1 or rows < 1 or not least <= whole(triangles, "town: triangles") <= MAX_TRIANGLES:
        raise InputError(
            f"town: wanted at least 1x1 lots and {max(least, 15)} to {MAX_TRIANGLES} triangles, got {columns}x{rows} "
            f"lots and {triangles} triangles"
        )
    if tree and whole(tree, "town: tree") <= trunk:
        raise InputError(f"town: tree: wanted more than {trunk} triangles, or 0 for none, got {tree}")
    rng = np.random.default_rng(seed)
    lower, upper = _houses(columns, rows, rng)
    balconies = (triangles - 2 - tree - _BOX * lots) // (_BOX * lots)
    ledges = _balconies(lower, upper, balconies)
    house = np.arange(1, lots + 1)
    boxes = np.concatenate([np.stack([lower, upper], axis=1), ledges.reshape(-1, 2, 3)])
    owner = np.concatenate([house, np.repeat(house, balconies)])
    colour = np.concatenate([[0], 1 + rng.integers(0, len(_COLORS), lots), [len(_COLORS) + 1]])
    order = np.argsort(owner, kind="stable")
    positions, faces = _meshed(boxes[order])
    x, z = LOT * (columns / 2 + 1), LOT * (rows / 2 + 1)
    ground = np.array([(-x, 0, -z), (-x, 0, z), (x, 0, z), (x, 0, -z)])
    parts, indices = [ground, positions], [np.array([(0, 1, 2), (0, 2, 3)]), faces + 4]
    objects = [np.zeros(2, np.int64), np.repeat(owner[order], _BOX)]
    if tree:
        crown, leaves = _tree(tree, LOT * (columns % 2) / 2, LOT * (rows % 2) / 2, rng)
        parts.append(crown)
        indices.append(leaves + 4 + len(positions))
        objects.append(np.full(tree, lots + 1))
    object_id = np.concatenate(objects)
    return Scene(
        np.concatenate(parts).astype(np.float32),
        np.concatenate(indices),
        materials=[
            Material((0.45, 0.45, 0.46, 1.0), name="ground"),
            *(Material((*color, 1.0), name=f"house {i}") for i, color in enumerate(_COLORS)),
            Material((0.20, 0.34, 0.14, 1.0), name="tree"),
        ],
        material_id=colour[object_id],
        object_id=object_id,
    )


def town_walk(grid: tuple[int, int], progress: float, width: int, height: int) -> Camera:
    """The camera of somebody who walks down the street in the middle: at 0 at one end, at 1 at the other."""
    x = LOT * (grid[0] % 2) / 2 - 2.0
    z = LOT * grid[1] / 2 * (1.0 - 1.8 * progress)
    sway = 0.35 * math.sin(9.0 * progress)
    return Camera.look_at((x, 1.7, z), (x + 20 * sway, 3.5, z - 20.0), fov_y=60, width=width, height=height)


def town_flight(grid: tuple[int, int], progress: float, width: int, height: int) -> Camera:
    """A camera above the roofs, on its way over the town."""
    reach = LOT * max(grid) / 2
    z = reach * (1.2 - 1.4 * progress)
    return Camera.look_at((0.2 * reach, 0.45 * reach + 60, z), (0, 0, z - 0.8 * reach), width=width, height=height)


def town_sun() -> Light:
    """An afternoon's sun, which leaves streets half in shadow."""
    return Light.sun(235.0, 38.0)


def _houses(columns: int, rows: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Lower and upper corners of the houses' walls."""
    number = np.arange(columns * rows)
    middle = np.stack([number % columns - (columns - 1) / 2, number // columns - (rows - 1) / 2], axis=1) * LOT
    half = rng.uniform(5.5, 8.5, (len(number), 2))
    floors = rng.integers(2, 9, len(number))
    lower = np.stack([middle[:, 0] - half[:, 0], np.zeros(len(number)), middle[:, 1] - half[:, 1]], axis=1)
    upper = np.stack([middle[:, 0] + half[:, 0], 3.2 * floors + 1.0, middle[:, 1] + half[:, 1]], axis=1)
    return lower, upper


def _balconies(lower: Floats, upper: Floats, count: int) -> Floats:
    """`(houses, count, 2, 3)` corners of `count` balconies on each house, floor by floor on its four sides."""
    number = np.arange(count)
    side, place = number % 4, number // 4
    floors = np.maximum(1, ((upper[:, 1] - 1.0) / 3.2).round().astype(np.int64))[:, None]
    bays = np.maximum(1, -(-(count + 3) // (4 * floors)))
    floor, bay = place % floors, place // floors
    share = (bay + 0.5) / bays
    width = 0.35 / bays
    y = 3.2 * floor + 1.0
    boxes = np.empty((len(lower), count, 2, 3))
    along, across = np.where(side % 2 == 0, 0, 2), np.where(side % 2 == 0, 2, 0)
    rows, columns = np.arange(len(lower))[:, None], number[None, :]
    low, high = lower[rows, along], upper[rows, along]
    wall = np.where(side < 2, lower[rows, across], upper[rows, across])
    outwards = np.where(side < 2, -0.9, 0.9)
    boxes[rows, columns, 0, along] = low + (share - width) * (high - low)
    boxes[rows, columns, 1, along] = low + (share + width) * (high - low)
    boxes[rows, columns, 0, across] = np.minimum(wall, wall + outwards)
    boxes[rows, columns, 1, across] = np.maximum(wall, wall + outwards)
    boxes[..., 0, 1], boxes[..., 1, 1] = y, y + 0.9
    return boxes


def _meshed(boxes: Floats) -> tuple[Floats, NDArray[np.int64]]:
    """Positions and triangles of boxes `(n, 2, 3)`."""
    bits = np.arange(8)[:, None] >> np.arange(3) & 1
    positions = np.where(bits, boxes[:, None, 1], boxes[:, None, 0])
    faces = np.concatenate([_FACES[:, [0, 1, 2]], _FACES[:, [0, 2, 3]]])
    triangles = 8 * np.arange(len(boxes))[:, None, None] + faces
    return positions.reshape(-1, 3), triangles.reshape(-1, 3)


def _tree(count: int, x: float, z: float, rng: np.random.Generator) -> tuple[Floats, NDArray[np.int64]]:
    """A trunk, and leaves in a round crown."""
    trunk, faces = _meshed(np.array([[(x - 0.3, 0.0, z - 0.3), (x + 0.3, 5.0, z + 0.3)]]))
    leaves = count - len(faces)
    direction = rng.normal(size=(leaves, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    middle = np.array([x, 7.5, z]) + direction * (3.2 * rng.random((leaves, 1)) ** (1 / 3))
    size = 0.6 / max(1.0, (leaves / 2000) ** (1 / 3))
    corners = middle[:, None] + rng.normal(scale=size / 2, size=(leaves, 3, 3))
    triangles = len(trunk) + np.arange(3 * leaves).reshape(-1, 3)
    return np.concatenate([trunk, corners.reshape(-1, 3)]), np.concatenate([faces, triangles])
