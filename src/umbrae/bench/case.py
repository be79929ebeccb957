"""What is measured: a scene, a light and a size, seen a little differently in every run."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from umbrae.bench.flythrough import FlyThrough
from umbrae.bench.scenes import MOVING, SCENES, extent
from umbrae.camera import Camera
from umbrae.light import Light
from umbrae.scene import Scene

LIGHTS = ("point", "directional")
WARM_UPS = 2
"""Runs before those that count: the first cold, the second cold and warm."""
STEP = 1e-3
"""How far camera and light move from run to run, as a share of the scene's extent."""


@dataclass(frozen=True)
class Case:
    """A scene's name from `SCENES`, a kind of light from `LIGHTS`, and a picture size in pixels."""

    scene: str
    light: str
    width: int
    height: int

    def __str__(self) -> str:
        return f"{self.scene} {self.light} {self.width}x{self.height}"


@dataclass(frozen=True)
class View:
    """One run's camera and light."""

    camera: Camera
    light: Light


def cases(scenes: Sequence[str], lights: Sequence[str], sizes: Sequence[tuple[int, int]]) -> list[Case]:
    """All combinations, those of a scene one after the other."""
    return [Case(scene, light, *size) for scene in scenes for size in sizes for light in lights]


def views(case: Case, scene: Scene, runs: int, path: FlyThrough | None = None) -> list[View]:
    """The views of a case: `WARM_UPS`, then one for each run.

    Nothing that a caster remembers of one run fits the next: the light moves by `STEP`, and so does the camera,
    sideways, unless it flies along a path.
    """
    setup, size = SCENES[case.scene], extent(scene)
    camera = setup.camera(scene, case.width, case.height)
    light = setup.light(scene, case.light == "directional")
    made = []
    for run in range(WARM_UPS + runs):
        if path is None:
            seen = replace(camera, eye=camera.eye + run * STEP * size * camera.axes[0])
        else:
            frame = max(0, run - WARM_UPS)
            seen = path.camera(frame / max(1, runs - 1), case.width, case.height, near=1e-4 * size)
        made.append(View(seen, _moved(light, run * STEP, size)))
    return made


def _moved(light: Light, share: float, size: float) -> Light:
    """A point light moved by a share of the scene's extent; one far away by that share of its direction's length."""
    position = light.position.astype(np.float64)
    scale = float(np.linalg.norm(position[:3])) if light.is_directional else size
    position[:3] += share * scale * np.array(MOVING)
    return replace(light, position=position.astype(np.float32))
