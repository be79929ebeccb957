"""A tree: tapered branches, and sprigs of leaves cut out of cards by their texture."""

import math

import numpy as np
from numpy.typing import NDArray

from umbrae.models.builder import Builder, Point

Floats = NDArray[np.float64]

GOLDEN_ANGLE = math.radians(137.5)
"""Turn between successive shoots around a stem, as in phyllotaxis."""


def tree(build: Builder, foot: Point, height: float, seed: int) -> None:
    """Add a tree in the materials "bark" and "leaf" to a builder, with a round crown."""
    rng = np.random.default_rng(seed)
    tips: list[Floats] = []
    _grow(
        build,
        rng,
        np.asarray(foot, np.float64),
        np.array([0.04, 1.0, 0.02]),
        0.36 * height,
        0.032 * height,
        3,
        tips,
    )
    cards = [card for tip in tips for card in _cards(rng, tip, 0.075 * height)]
    build.quads(np.array(cards), "leaf", np.tile([(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)], (len(cards), 1, 1)))


def _grow(
    build: Builder,
    rng: np.random.Generator,
    start: Floats,
    direction: Floats,
    length: float,
    radius: float,
    levels: int,
    tips: list[Floats],
) -> None:
    """Add a branch and, from it, its shoots; collect the places where leaves sit."""
    along = direction / np.linalg.norm(direction)
    end = start + length * along
    taper = [(radius, 0.0), (0.62 * radius, length)]
    build.lathe(taper, start, "bark", 6 + 3 * levels, along)
    if levels < 2:
        tips.append(end)
    if levels < 1:
        return
    side = np.cross(along, (0.31, 0.23, 0.92))
    side /= np.linalg.norm(side)
    other = np.cross(along, side)
    first = rng.uniform(0.0, 2.0 * math.pi)
    shoots = 5
    for k in range(shoots):
        turn = first + k * GOLDEN_ANGLE
        lean = 0.28 if k == shoots - 1 else rng.uniform(0.7, 1.0)
        around = math.cos(turn) * side + math.sin(turn) * other
        heading = math.cos(lean) * along + math.sin(lean) * around + (0.0, 0.12, 0.0)
        origin = start + length * (0.62 + 0.38 * (k + 1) / shoots) * along
        reach = length * rng.uniform(0.58, 0.78)
        _grow(build, rng, origin, heading, reach, 0.56 * radius, levels - 1, tips)


def _cards(rng: np.random.Generator, tip: Floats, size: float) -> list[list[Floats]]:
    """Squares around a twig's end, facing more up than sideways."""
    cards = []
    for _ in range(8):
        centre = tip + rng.uniform(-1.0, 1.0, 3) * size
        normal = np.array([-0.4, 0.8, 0.3]) + rng.normal(0.0, 0.6, 3)
        across = np.cross(normal, rng.normal(0.0, 1.0, 3))
        across /= np.linalg.norm(across)
        along = np.cross(normal / np.linalg.norm(normal), across)
        half = 0.5 * size * rng.uniform(0.8, 1.3)
        cards.append([centre + half * (sx * across + sy * along) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    return cards
