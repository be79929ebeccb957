"""A garden pavilion in late sun: a model on a wooden base, with everything that makes shadows interesting."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from umbrae.camera import Camera
from umbrae.light import Light
from umbrae.material import AlphaMode, Material
from umbrae.models import textures
from umbrae.models.builder import Builder
from umbrae.models.tree import tree
from umbrae.scene import Scene

FLOOR = 0.6
"""Height of the platform; the lawn is y = 0. Units are metres, north is -z."""
CEILING = 3.7
COLUMNS_X = (-1.2, 1.9, 5.0, 8.1)
COLUMNS_Z = (-3.6, 1.7)
SKYLIGHT = (-0.3, 2.5, -1.4, 1.2)
"""West, east, north and south."""


def pavilion() -> Scene:
    """A small piece of architecture: columns, stairs, louvres, coloured glass, a tree, open sheets."""
    build = Builder(_materials())
    _ground(build)
    _platform(build)
    _temple(build)
    _walls(build)
    _louvres(build)
    _glass(build)
    _sheets(build)
    _furniture(build)
    tree(build, (-7.6, 0.0, 6.4), height=6.6, seed=8)
    return build.scene()


def pavilion_camera(width: int = 1920, height: int = 1080) -> Camera:
    """The view of `pavilion` from the garden in front of it."""
    return Camera.look_at((7.0, 7.4, 25.0), (0.2, 0.6, 0.6), fov_y=36.0, width=width, height=height)


def pavilion_light() -> Light:
    """The sun on `pavilion`, late in the afternoon."""
    return Light.sun(238.0, 32.0, color=(1.0, 0.92, 0.79))


def _ground(build: Builder) -> None:
    build.box((-11.3, -0.7, -8.0), (12.2, -0.06, 9.0), "walnut")
    build.quad([(-11.3, 0, 9), (12.2, 0, 9), (12.2, 0, -8), (-11.3, 0, -8)], "lawn")
    build.box((-11.3, -0.06, -8.0), (12.2, -0.01, 9.0), "edge")
    build.box((-2.0, -0.005, 4.9), (12.2, 0.05, 9.0), "paving")


def _platform(build: Builder) -> None:
    build.box((-9.0, 0.0, -5.5), (-8.0, FLOOR, 3.5), "floor")
    build.box((-8.0, 0.0, -5.5), (-3.4, FLOOR, -1.6), "floor")
    build.box((-8.0, 0.0, 2.7), (-3.4, FLOOR, 3.5), "floor")
    build.box((-3.4, 0.0, -5.5), (9.5, FLOOR, 3.5), "floor")
    build.quad([(-8, 0.42, 2.7), (-3.4, 0.42, 2.7), (-3.4, 0.42, -1.6), (-8, 0.42, -1.6)], "water")
    build.stairs((0.0, 0.05, 3.5), (4.4, FLOOR, 5.1), 4, "floor")
    for x in (-0.3, 4.4):
        build.box((x, 0.0, 3.5), (x + 0.3, FLOOR + 0.02, 5.3), "stone")


def _temple(build: Builder) -> None:
    """Columns, the beams on them, and a roof slab with a skylight."""
    shaft = [(0.23 - 0.035 * t**1.6, 0.16 + 2.34 * t) for t in (0.0, 0.25, 0.5, 0.75, 1.0)]
    foot = [(0.27, 0.0), (0.3, 0.04), (0.3, 0.1), (0.25, 0.16)]
    head = [(0.19, 2.5), (0.21, 2.56), (0.28, 2.66), (0.29, 2.7)]
    for z in COLUMNS_Z:
        for x in COLUMNS_X:
            build.lathe(foot, (x, FLOOR, z), "plaster", 32)
            build.lathe(shaft, (x, FLOOR, z), "plaster", 64, flutes=16)
            build.lathe(head, (x, FLOOR, z), "plaster", 32)
            build.box((x - 0.3, FLOOR + 2.7, z - 0.3), (x + 0.3, FLOOR + 2.8, z + 0.3), "plaster")
    west, east, north, south = (
        COLUMNS_X[0] - 0.25,
        COLUMNS_X[-1] + 0.25,
        COLUMNS_Z[0] - 0.25,
        COLUMNS_Z[1] + 0.25,
    )
    for z in COLUMNS_Z:
        build.box((west, FLOOR + 2.8, z - 0.25), (east, CEILING, z + 0.25), "plaster")
    for x in (COLUMNS_X[0], COLUMNS_X[-1]):
        build.box((x - 0.25, FLOOR + 2.8, north + 0.5), (x + 0.25, CEILING, south - 0.5), "plaster")
    _slab_with_hole(build, (west - 0.28, CEILING, north - 0.28), (east + 0.28, CEILING + 0.2, south + 0.28), "plaster")
    _slab_with_hole(build, (west - 0.1, CEILING + 0.2, north - 0.1), (east + 0.1, CEILING + 0.32, south + 0.1), "roof")
    for z in np.linspace(SKYLIGHT[2] + 0.2, SKYLIGHT[3] - 0.2, 5):
        build.beam((SKYLIGHT[0] - 0.1, CEILING + 0.4, z), (SKYLIGHT[1] + 0.1, CEILING + 0.4, z), 0.06, 0.14, "timber")


def _slab_with_hole(build: Builder, low: Sequence[float], high: Sequence[float], material: str) -> None:
    (x0, y0, z0), (x1, y1, z1) = low, high
    left, right, back, front = SKYLIGHT
    build.box((x0, y0, z0), (left, y1, z1), material)
    build.box((right, y0, z0), (x1, y1, z1), material)
    build.box((left, y0, z0), (right, y1, back), material)
    build.box((left, y0, front), (right, y1, z1), material)


def _walls(build: Builder) -> None:
    build.box((-9.0, FLOOR, -5.3), (0.8, 3.1, -5.0), "travertine")
    build.box((-9.1, 3.1, -5.36), (0.9, 3.2, -4.94), "plaster")
    build.box((2.2, FLOOR, -2.75), (7.6, 3.3, -2.55), "marble")
    build.box((6.4, 0.05, 7.8), (10.8, 0.5, 8.2), "stone")
    build.box((6.3, 0.5, 7.72), (10.9, 0.58, 8.28), "plaster")


def _louvres(build: Builder) -> None:
    """Upright fins between the western columns, and a pergola of open slats in the east."""
    for z in np.linspace(-3.0, 1.1, 11):
        build.box((-1.35, FLOOR, z - 0.03), (-1.1, FLOOR + 2.8, z + 0.03), "timber")
    slats = [
        [(9.0, y, z), (11.8, y, z), (11.8, y + 0.16, z - 0.16), (9.0, y + 0.16, z - 0.16)]
        for y, z in zip(np.full(17, 2.72), np.linspace(2.4, -2.9, 17), strict=True)
    ]
    build.quads(slats, "timber")
    for x in (9.2, 11.6):
        build.beam((x, 2.64, 2.7), (x, 2.64, -3.3), 0.12, 0.16, "timber")
        for z in (2.5, -3.1):
            build.beam((x, 0.0 if x > 9.5 else FLOOR, z), (x, 2.56, z), 0.12, 0.12, "timber")


def _glass(build: Builder) -> None:
    """A frieze of coloured panes between the southern columns, some blended, some transmitting."""
    low, high, z = FLOOR + 1.85, FLOOR + 2.75, COLUMNS_Z[1]
    panes = 3
    for bay, (west, east) in enumerate(pairwise(COLUMNS_X)):
        edges = np.linspace(west + 0.22, east - 0.22, panes + 1)
        for i, (x0, x1) in enumerate(pairwise(edges)):
            kind = ("amber", "red", "blue")[(i + bay) % 3] + (" glass" if i == panes // 2 else " film")
            build.quad([(x0, low, z), (x1, low, z), (x1, high, z), (x0, high, z)], kind)
        for y in (low, high):
            build.beam((edges[0], y, z), (edges[-1], y, z), 0.06, 0.06, "bronze")
        for x in edges:
            build.beam((x, low, z), (x, high, z), 0.05, 0.05, "bronze")


def _sheets(build: Builder) -> None:
    """Open sheets: an awning of strips, a folded paper screen, and three fins that meet at one edge."""
    for i in range(10):
        x, width = -8.2 + 0.44 * i, 0.44
        strip = [(x, 2.25, -3.3), (x + width, 2.25, -3.3), (x + width, 2.85, -5.0), (x, 2.85, -5.0)]
        hem = [(x, 2.0, -3.28), (x + width, 2.0, -3.28), (x + width, 2.25, -3.3), (x, 2.25, -3.3)]
        build.quads([strip, hem], "canvas red" if i % 2 == 0 else "canvas white")
    for x in (-8.2, -3.8):
        build.beam((x, FLOOR, -3.3), (x, 2.25, -3.3), 0.06, 0.06, "bronze")
    folds = [(8.6 + 0.4 * i, 4.6 + 0.3 * (i % 2)) for i in range(8)]
    build.quads(
        [[(x0, 0, z0), (x1, 0, z1), (x1, 1.3, z1), (x0, 1.3, z0)] for (x0, z0), (x1, z1) in pairwise(folds)],
        "paper",
    )
    x0, z0 = -3.4, 7.4
    build.lathe([(0.75, 0.0), (0.75, 0.2)], (x0, 0.0, z0), "stone", 48)
    fins = []
    for turn, rise in ((0.1, 1.3), (3.35, 2.0), (4.8, 1.6)):
        x, z = x0 + 0.6 * math.cos(turn), z0 + 0.6 * math.sin(turn)
        fins.append([(x0, 0.2, z0), (x, 0.2, z), (x, rise, z), (x0, 2.4, z0)])
    build.quads(fins, "corten")


def _furniture(build: Builder) -> None:
    """A bench under the awning, clipped bushes and cypresses."""
    for x in (-7.4, -4.9):
        build.box((x, FLOOR, -4.6), (x + 0.3, 1.0, -4.0), "stone")
    for z in np.arange(-4.6, -3.95, 0.15):
        build.box((-7.7, 1.0, z), (-4.3, 1.06, z + 0.11), "timber")
    ball = [(math.cos(t), math.sin(t)) for t in np.linspace(-math.pi / 2, math.pi / 2, 17)]
    ball[0], ball[-1] = (0.0, -1.0), (0.0, 1.0)
    for x, z, radius in (
        (-3.3, 4.6, 0.55),
        (-4.6, 4.4, 0.38),
        (11.2, 3.9, 0.6),
        (12.1, 4.7, 0.4),
        (-10.2, -1.5, 0.6),
    ):
        build.lathe([(radius * r, radius * (y + 0.85)) for r, y in ball], (x, 0.0, z), "bush", 32)
    pot = [(0.2, 0.0), (0.36, 0.3), (0.4, 0.55), (0.46, 0.57), (0.46, 0.64), (0.38, 0.64)]
    for x, z in ((-0.8, 5.5), (5.2, 5.5)):
        build.lathe(pot, (x, 0.05, z), "corten", 32)
        build.lathe([(0.4 * r, 0.4 * (y + 0.8)) for r, y in ball], (x, 0.64, z), "bush", 24)
    spindle = [
        (0.0, 0.0),
        (0.3, 0.1),
        (0.55, 0.9),
        (0.62, 1.7),
        (0.52, 2.9),
        (0.3, 4.2),
        (0.12, 4.9),
        (0.0, 5.2),
    ]
    for x, z, size in (
        (3.2, -6.9, 0.95),
        (5.0, -7.0, 1.12),
        (6.8, -6.8, 0.88),
        (-10.0, -6.3, 1.15),
        (-8.5, -6.9, 0.9),
    ):
        build.lathe([(size * r, size * y) for r, y in spindle], (x, 0.0, z), "cypress", 28)


def _materials() -> list[Material]:
    def plain(name: str, color: str, alpha: float = 1.0, mode: AlphaMode = "OPAQUE", pass_on: float = 0.0) -> Material:
        return Material((*_linear(color), alpha), mode, transmission=pass_on, name=name)

    def pictured(name: str, texture: textures.Texture, mode: AlphaMode = "OPAQUE") -> Material:
        return Material((1.0, 1.0, 1.0, 1.0), mode, texture=texture, name=name)

    return [
        plain("walnut", "4b382c"),
        plain("edge", "6b5a3e"),
        plain("plaster", "efe5d3"),
        plain("stone", "cdb995"),
        plain("roof", "ddd0b8"),
        plain("water", "2c6a70"),
        plain("bronze", "4a3b2c"),
        plain("corten", "b9603a"),
        plain("paper", "f8f3e6"),
        plain("canvas red", "b8452f"),
        plain("canvas white", "f3e9d6"),
        plain("bush", "66863f"),
        plain("cypress", "40603b"),
        plain("bark", "6a5040"),
        *(
            plain(f"{tone} {kind}", color, *options)
            for tone, color in (("red", "c22f36"), ("blue", "2b62c0"), ("amber", "f0a524"))
            for kind, options in (("film", (0.4, "BLEND")), ("glass", (1.0, "OPAQUE", 0.8)))
        ),
        pictured("lawn", textures.mottled(128, "a3ae72", "8c9c5e", seed=1)),
        pictured("paving", textures.paving(256, 4, "d6c8b0", "bfae94", seed=2)),
        pictured("floor", textures.paving(256, 2, "ead9b9", "d3be98", seed=3)),
        pictured("travertine", textures.bands(256, "e6cfa4", "c6a678", seed=4)),
        pictured("marble", textures.marble(256, "8fb59c", "2c5f4b", seed=5)),
        pictured("timber", textures.bands(128, "7d5b41", "5a402c", seed=6)),
        pictured("leaf", textures.sprig(128, "b3c765", "7a9f45", seed=7), "MASK"),
    ]


def _linear(color: str) -> tuple[float, float, float]:
    """Linear values of an sRGB colour given as `rrggbb`."""
    r, g, b = ((c / 255 / 12.92 if c <= 10 else ((c / 255 + 0.055) / 1.055) ** 2.4) for c in bytes.fromhex(color))
    return r, g, b
