"""What Milet, Kobrtek, Zemcik and Peciva fly through: spheres in a grid, a sphere over a box, Sponza."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from umbrae import models
from umbrae.bench.case import STEP, View
from umbrae.bench.flythrough import FlyThrough, Place
from umbrae.bench.scenes import SCENES, extent
from umbrae.bench.sintorn_flythrough import FLIGHTS
from umbrae.camera import Camera
from umbrae.material import Material
from umbrae.models.builder import Builder
from umbrae.models.sphere_scene import HEIGHT, SPACING
from umbrae.scene import Scene

SPHERES_SECONDS, SPONZA_SECONDS = 16, 40
"""How long the paper's flights take; their paths are not told."""

Grid = tuple[int, int]

_AROUND: Sequence[Place] = (
    (1.3, 0.9, 1.3),
    (0.2, 0.5, 1.2),
    (-0.7, 0.15, 0.4),
    (-0.2, 0.05, -0.3),
    (0.5, 0.2, -0.9),
    (1.2, 0.7, -0.6),
)
"""Where the camera is: x and z as shares of the scene's reach, y of it above the spheres."""


def grid_of(count: int) -> Grid:
    """So many spheres in rows as nearly square as can be."""
    rows = next(n for n in range(math.isqrt(count), 0, -1) if count % n == 0)
    return rows, count // rows


def box_and_sphere(triangles: int) -> Scene:
    """A sphere of so many triangles, but for the 12 of a box under it."""
    build = Builder([Material(name="box")])
    build.box((-2 * SPACING, -1.0, -2 * SPACING), (2 * SPACING, 0.0, 2 * SPACING), "box")
    box, ball = build.scene(), models.spheres((1, 1), triangles - 10)
    # The first two triangles are the ground, whose four vertices come first.
    return Scene(
        np.concatenate([box.positions, ball.positions[4:]]),
        np.concatenate([box.triangles, ball.triangles[2:] - 4 + len(box.positions)]),
        object_id=np.repeat([0, 1], [len(box.triangles), len(ball.triangles) - 2]),
    )


def spheres_views(grid: Grid, frames: int, size: tuple[int, int]) -> list[View]:
    """Around the spheres, and close above them."""
    reach = SPACING * (max(grid) / 2 + 1)
    above = HEIGHT + 1.2
    places = [((x * reach, above + y * reach, z * reach), (-0.2 * x * reach, HEIGHT, 0.0)) for x, y, z in _AROUND]
    path = FlyThrough.between("spheres", SPHERES_SECONDS, places)
    light = models.spheres_light(grid)
    return [View(camera, light) for camera in path.cameras(frames, *size, near=1e-3 * reach)]


def sponza_views(scene: Scene, frames: int, size: tuple[int, int]) -> list[View]:
    """Through the court and its galleries."""
    path = FlyThrough.between("sponza", SPONZA_SECONDS, FLIGHTS["sponza"])
    light = SCENES["sponza"].light(scene, directional=False)
    return [View(camera, light) for camera in path.cameras(frames, *size, near=1e-4 * extent(scene))]


def facing_views(scene: Scene, grid: Grid, frames: int, size: tuple[int, int], away: bool) -> list[View]:
    """From where all of the scene is in view; or from the same place with the back to it, and nothing in view."""
    camera = Camera.frame(scene, width=size[0], height=size[1])
    light = models.spheres_light(grid)
    # Half a turn around what is up in the picture.
    axes = camera.axes * np.array([[-1.0], [1.0], [-1.0]]) if away else camera.axes
    step = STEP * extent(scene) * camera.axes[0]
    return [View(replace(camera, eye=camera.eye + frame * step, axes=axes), light) for frame in range(frames)]


def without_textures(scene: Scene) -> Scene:
    """The same scene, its materials in their base colours."""
    plain = [replace(one, texture=None) for one in scene.materials]
    return Scene(
        scene.positions, scene.triangles, plain, scene.material_id, scene.normals, scene.uv, scene.object_id,
        scene.colors, scene.origin,
    )  # fmt: skip
