"""Coloured glass behind coloured glass, layer by layer: Figure 1c of Sintorn, Olsson and Assarsson 2011."""

import dataclasses
from functools import partial

from umbrae import models
from umbrae.bench.case import STEP, View
from umbrae.bench.sweep import Sweep, SweepRecord
from umbrae.bench.sweep_run import Column, run_sweep
from umbrae.camera import Camera
from umbrae.clock import Clock
from umbrae.light import Light
from umbrae.methods import make_method
from umbrae.samples import ViewSamples
from umbrae.sampling import sample_layers
from umbrae.scene import Scene

SIZE = (1024, 1024)
LAYERS = 8
"""As many as the paper peels."""
GRID, TRIANGLES = (8, 8), 60_000
CHECKED = 2_000

NOTE = (
    "Shadows of the samples of one layer at a time, those of the nearest surfaces first; finding the layers is not "
    "timed. Spheres of coloured glass stand in for the paper's scene, which was not to be had: its eight layers took "
    "75.7 ms in all, 5 to 19 ms each, with 60,000 triangles on a GTX480."
)


def glass() -> Scene:
    """Rows of spheres that tint what passes, on a solid ground; about as many triangles as the paper has."""
    scene = models.spheres(GRID, TRIANGLES)
    ground, *spheres = scene.materials
    tinted = [dataclasses.replace(one, alpha_mode="BLEND", transmission=0.8) for one in spheres]
    return Scene(
        scene.positions, scene.triangles, [ground, *tinted], scene.material_id, scene.normals, object_id=scene.object_id
    )


def views(frames: int, size: tuple[int, int]) -> list[View]:
    """Along the rows, low, so that spheres stand behind one another; the light moves a little."""
    camera = Camera.look_at((2.0, 3.6, 17.0), (0.3, 0.9, 0.0), fov_y=38.0, width=size[0], height=size[1])
    position = models.spheres_light(GRID).position[:3]
    return [View(camera, Light.point(position + frame * STEP)) for frame in range(frames)]


def run_layers(layers: int, opengl: bool, frames: int, size: tuple[int, int], clock: Clock) -> SweepRecord:
    """Each layer in turn, as far as there are so many, by `frustum` and by `frustum-gl`."""
    scene, seen = glass(), views(frames, size)
    rows = {name: make_method(name) for name in ("frustum", "frustum-gl")[: 1 + opengl]}
    columns = [
        Column(str(number), lambda: scene, lambda _: seen, rows, seen=partial(_layer, number))
        for number, _ in enumerate(sample_layers(scene, seen[0].camera, layers), 1)
    ]
    sweep = Sweep(
        "sintorn-layers",
        "Glass behind glass",
        "Sintorn, Olsson, Assarsson 2011, Figure 1c",
        "layer",
        tuple(column.name for column in columns),
        "frustum",
        size=size,
        note=NOTE,
    )
    return run_sweep(sweep, columns, CHECKED, clock)


def _layer(number: int, scene: Scene, camera: Camera) -> ViewSamples:
    """Only the samples that lie behind `number` - 1 others."""
    return sample_layers(scene, camera, number)[number - 1]
