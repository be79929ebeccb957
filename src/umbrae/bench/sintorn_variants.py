"""Trees with different leaves: Figure 8 of Sintorn, Olsson and Assarsson 2011."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np

from umbrae.bench.case import STEP, View
from umbrae.bench.scenes import BenchScene
from umbrae.bench.sweep import PaperRow, Sweep, SweepRecord
from umbrae.bench.sweep_run import Column, run_sweep
from umbrae.camera import Camera
from umbrae.clock import Clock
from umbrae.light import Light
from umbrae.material import Material
from umbrae.methods import Method, make_method
from umbrae.models.builder import Builder
from umbrae.models.textures import sprig
from umbrae.models.tree import tree
from umbrae.scene import Scene

SIZE = (1024, 1024)
CHECKED = 2_000

GROVE = ((0.0, 0.0), (-3.0, -3.0), (3.0, -3.0), (-3.0, 3.0), (3.0, 3.0))
"""Where trees of Umbrae's own stand, x and z: about as many triangles as the paper's tree has, 35,000."""


def grove() -> Scene:
    """Five small trees, their leaves cut out of cards."""
    leaf = Material((1.0, 1.0, 1.0, 1.0), "MASK", texture=sprig(128, "b3c765", "7a9f45", seed=7), name="leaf")
    build = Builder([Material((0.28, 0.2, 0.14, 1.0), name="bark"), leaf])
    for number, (x, z) in enumerate(GROVE):
        tree(build, (x, 0.0, z), height=4.0, seed=8 + number)
    return build.scene()


SCENES: dict[str, BenchScene] = {
    "grove": BenchScene(grove),
    "pine": BenchScene("foliage/smallpine/pine-mask.gltf"),
    "forest": BenchScene("foliage/smallpine/pine-forest-196-mask.gltf"),
}
"""They stand in for the paper's tree."""

Leaf = Callable[[Material], Material]

LEAVES: dict[str, tuple[Leaf, str]] = {
    "binary": (lambda leaf: dataclasses.replace(leaf, alpha_mode="OPAQUE"), "exact"),
    "cut out": (lambda leaf: dataclasses.replace(leaf, alpha_mode="MASK"), "exact"),
    "half": (lambda leaf: Material((0.35, 0.5, 0.15, 0.5), "BLEND", name=leaf.name), "exact"),
    "textured": (lambda leaf: dataclasses.replace(leaf, alpha_mode="BLEND"), "exact"),
    "textured, by chance": (lambda leaf: dataclasses.replace(leaf, alpha_mode="BLEND"), "stochastic"),
    "coloured": (lambda leaf: Material((0.35, 0.6, 0.2, 1.0), "BLEND", transmission=0.8, name=leaf.name), "exact"),
}
"""By row: the leaves' material, and `transparency`."""

PAPER = {"binary": 7.9, "half": 8.6, "textured": 12.9, "textured, by chance": 12.9, "coloured": 10.4}
"""Milliseconds (section 4)."""

NOTE = (
    "Grove, pine and forest stand in for the paper's tree of 35,000 triangles, which was not to be had. Each variant "
    "shades the samples of its own picture: behind leaves that are cut out, half or coloured there are others than on "
    "solid cards. The light moves a little from frame to frame. 'cut out' is not in the figure."
)


def over_ground(scene: Scene) -> Scene:
    """The scene around the origin on a floor three times as wide."""
    low, high = scene.bounds.astype(np.float64)
    middle, reach = (low + high) / 2, 1.5 * float((high - low).max())
    positions = scene.positions - np.array([middle[0], low[1], middle[2]])
    uv = np.zeros((len(positions), 2)) if scene.uv is None else scene.uv
    floor = np.array([(-reach, 0, reach), (reach, 0, reach), (reach, 0, -reach), (-reach, 0, -reach)])
    return Scene(
        np.concatenate([positions, floor]),
        np.concatenate([scene.triangles, len(positions) + np.array([(0, 1, 2), (0, 2, 3)])]),
        [*scene.materials, Material((0.75, 0.74, 0.7, 1.0), name="floor")],
        np.append(scene.material_id, 2 * [len(scene.materials)]),
        uv=np.concatenate([uv, np.zeros((4, 2))]),
        object_id=np.append(scene.object_id, 2 * [scene.object_id.max(initial=0) + 1]),
    )


def with_leaves(leaf: Leaf) -> Callable[[Scene], Scene]:
    """A function that gives a scene other leaves: all that is of a material which is not solid."""

    def look(scene: Scene) -> Scene:
        materials = [one if one.casts_solid else leaf(one) for one in scene.materials]
        return Scene(
            scene.positions, scene.triangles, materials, scene.material_id, uv=scene.uv, object_id=scene.object_id
        )

    return look


def views(scene: Scene, frames: int, size: tuple[int, int]) -> list[View]:
    """From the side and above; the light stands over it."""
    # The floor is three times as wide as the rest.
    low, high = scene.bounds.astype(np.float64)
    height, wide = float(high[1]), float((high - low).max()) / 3
    eye, target = (0.15 * wide, 0.55 * wide + 0.6 * height, 1.35 * wide), (0.1 * wide, 0.4 * height, 0.0)
    camera = Camera.look_at(eye, target, fov_y=40.0, width=size[0], height=size[1])
    return [
        View(camera, Light.point(((STEP * frame - 0.6) * wide, height + 0.9 * wide, 0.3 * wide)))
        for frame in range(frames)
    ]


def run_variants(
    folder: Path | None, names: list[str], opengl: bool, frames: int, size: tuple[int, int], clock: Clock
) -> SweepRecord:
    """All variants of each scene, by `frustum` and by `frustum-gl`, in turns."""

    def column(name: str, method: str) -> Column:
        rows: dict[str, Method] = {
            row: make_method(method, transparency=transparency) for row, (_, transparency) in LEAVES.items()
        }
        return Column(
            f"{name}, {method}",
            lambda: over_ground(SCENES[name].read(folder)),
            lambda scene: views(scene, frames, size),
            rows,
            {row: with_leaves(leaf) for row, (leaf, _) in LEAVES.items()},
        )

    columns = [column(name, method) for name in names for method in ("frustum", "frustum-gl")[: 1 + opengl]]
    titles = tuple(column.name for column in columns)
    paper = tuple(PaperRow(row, "tree, GTX480", dict.fromkeys(titles, value)) for row, value in PAPER.items())
    sweep = Sweep(
        "sintorn-variants",
        "Trees with different leaves",
        "Sintorn, Olsson, Assarsson 2011, Figure 8",
        "scene and method",
        titles,
        "binary",
        paper,
        size,
        NOTE,
    )
    return run_sweep(sweep, columns, CHECKED, clock)
