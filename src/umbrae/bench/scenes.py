"""The scenes that are measured: made by Umbrae itself, or models read from a folder."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from umbrae import models
from umbrae.bench.grazed import Grazed
from umbrae.camera import Camera
from umbrae.errors import ModelError
from umbrae.files import load
from umbrae.light import Light
from umbrae.scene import Scene

TOWARDS = (-1.0, -2.0, -0.7)
"""The way that the directional light of every scene travels."""
MOVING = (1.0, 0.0, 0.5)
"""The way that lights move from run to run."""


@dataclass(frozen=True)
class BenchScene:
    """How to come by a scene, and from where to look at it and light it.

    Attributes
    ----------
    source
        A function that makes the scene, or the path of a model inside the folder of models.
    view
        The camera for a width and height in pixels; it frames the scene by itself without one.
    point
        Position of the point light; high above a corner of the scene without it.
    """

    source: Callable[[], Scene] | str
    view: Callable[[int, int], Camera] | None = None
    point: Callable[[], Light] | None = None

    def load(self, folder: Path | None) -> Scene:
        """Make or read the scene, every surface solid as rays have it.

        Raises `ModelError` when the model is not in the folder.
        """
        return self.read(folder).opaque()

    def read(self, folder: Path | None) -> Scene:
        """The same with its own materials."""
        if not isinstance(self.source, str):
            return self.source()
        if folder is None:
            raise ModelError(f"model {self.source} not found: no folder of models (give --models)")
        if not (folder / self.source).is_file():
            raise ModelError(f"model {self.source} not found in {folder} (give --models)")
        return load(folder / self.source)

    def camera(self, scene: Scene, width: int, height: int) -> Camera:
        """The camera of the first run."""
        return self.view(width, height) if self.view is not None else Camera.frame(scene, width=width, height=height)

    def light(self, scene: Scene, directional: bool) -> Light:
        """The light of the first run."""
        if directional:
            return Light.directional(TOWARDS)
        if self.point is not None:
            return self.point()
        size = extent(scene)
        return Light.point(scene.bounds.astype(np.float64).mean(axis=0) + size * np.array([0.3, 1.0, 0.2]))


def extent(scene: Scene) -> float:
    """The longest side of the bounds in world units."""
    low, high = scene.bounds.astype(np.float64)
    return float((high - low).max())


def default_folder() -> Path | None:
    """`shared/scenes` beside a source checkout, if it is there."""
    folder = Path(__file__).parents[4] / "shared" / "scenes"
    return folder if folder.is_dir() else None


_GRAZED = Grazed(TOWARDS, MOVING)

SCENES: dict[str, BenchScene] = {
    "pavilion": BenchScene(models.pavilion, view=models.pavilion_camera),
    "spheres-96k": BenchScene(lambda: models.spheres(triangles=96_000), point=models.spheres_light),
    "spheres-980k": BenchScene(lambda: models.spheres(triangles=980_000), point=models.spheres_light),
    "grazed": BenchScene(_GRAZED.scene, view=_GRAZED.camera, point=_GRAZED.light),
    "sponza": BenchScene(
        "sponza/sponza.gltf",
        view=lambda width, height: Camera.look_at((-1000, 200, 60), (500, 350, -60), width=width, height=height),
        point=lambda: Light.point((0.0, 900.0, 0.0)),
    ),
    "dragon-100k": BenchScene("stanford/dragon-100k.obj"),
    "dragon-871k": BenchScene("stanford/dragon_vrip.glb"),
    "city": BenchScene("city/linz-center-2km.glb"),
}
QUICK = ("spheres-96k", "pavilion")
FULL = ("spheres-96k", "spheres-980k", "sponza", "dragon-100k", "dragon-871k", "city", "grazed")
