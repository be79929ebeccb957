"""What a sun study leaves behind: arrays, a table, a coloured model."""

import datetime as dt
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbrae import files
from umbrae.formats.resources import linear
from umbrae.material import Material
from umbrae.samples import ViewSamples
from umbrae.scene import Scene
from umbrae.sun.colors import colors
from umbrae.sun.sensors import facets
from umbrae.sun.study import SunStudy

TABLES = (".npz", ".csv")
"""Extensions that hold every sensor."""
STUDIES = (*TABLES, *files.SCALAR_MODELS)
"""Extensions that `save_study` writes."""


def save_study(path: Path, scene: Scene, sensors: ViewSamples, study: SunStudy) -> None:
    """Write the hours of sensors `(n,)` on faces; the extension chooses.

    `.npz` and `.csv` hold every sensor, in the file's own coordinates. `.ply` and `.glb` hold the model, with the mean
    hours of each face's sensors as colour and as the number `hours` of its corners.

    Raises
    ------
    OutputError
        For an unknown extension or a path that cannot be written.
    """
    files.check_writable(path, STUDIES)
    kind = path.suffix.lower()
    if kind == ".npz":
        files.save_arrays(path, **_arrays(scene, sensors, study))
    elif kind == ".csv":
        files.save_table(path, _columns(scene, sensors, study))
    else:
        mesh, hours = _colored(scene, sensors, study)
        files.save(mesh, path, {"hours": hours})


def summary(scene: Scene, sensors: ViewSamples, study: SunStudy) -> dict[str, float]:
    """Least, mean (by area) and most hours of sensors `(n,)` on faces."""
    area = _surface(scene, sensors)[1]
    hours = study.hours
    return {
        "least_hours": float(hours.min()),
        "mean_hours": float(np.average(hours, weights=area)),
        "most_hours": float(hours.max()),
    }


def _arrays(scene: Scene, sensors: ViewSamples, study: SunStudy) -> dict[str, NDArray[Any]]:
    normal, area = _surface(scene, sensors)
    sky = study.sky
    return {
        "face": sensors.triangle,
        "barycentric": sensors.barycentric,
        "position": sensors.position + scene.origin,
        "normal": normal,
        "area": area,
        "hours": study.hours,
        "times": np.array([one.astimezone(dt.UTC).replace(tzinfo=None) for one in sky.times], "datetime64[ms]"),
        "azimuth": sky.azimuth,
        "elevation": sky.elevation,
        "directions": np.array([light.position[:3] for light in sky.lights]),
        "step_hours": np.array(sky.step_hours),
        "place": np.array([sky.latitude, sky.longitude]),
        "north": np.array(sky.north),
    }


def _columns(scene: Scene, sensors: ViewSamples, study: SunStudy) -> dict[str, NDArray[Any]]:
    normal, area = _surface(scene, sensors)
    x, y, z = (sensors.position + scene.origin if scene.origin.any() else sensors.position).T
    nx, ny, nz = normal.astype(np.float32).T
    named = {"face": sensors.triangle, "x": x, "y": y, "z": z, "nx": nx, "ny": ny, "nz": nz}
    return named | {"area": area.astype(np.float32), "hours": study.hours}


def _surface(scene: Scene, sensors: ViewSamples) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Normal of the studied side `(n, 3)`, and the area `(n,)` that a sensor stands for: its share of its face."""
    normal, area = facets(scene)
    own = sensors.triangle
    shares = np.bincount(own, minlength=len(area))
    return normal[own] * sensors.side[:, None] + 0.0, area[own] / shares[own]


def _colored(scene: Scene, sensors: ViewSamples, study: SunStudy) -> tuple[Scene, NDArray[np.float32]]:
    """The faces that have sensors, no corners shared, and the hours of each corner."""
    shares = np.bincount(sensors.triangle, minlength=len(scene.triangles))
    total = np.bincount(sensors.triangle, weights=study.hours, minlength=len(scene.triangles))
    face = np.flatnonzero(shares)
    hours = np.repeat(total[face] / shares[face], 3)
    color = linear(colors(hours, study.sky.possible_hours))
    mesh = Scene(
        scene.positions[scene.triangles[face].reshape(-1)],
        np.arange(3 * len(face)).reshape(-1, 3),
        [Material((1.0, 1.0, 1.0, 1.0), double_sided=True, name="sun hours")],
        object_id=scene.object_id[face],
        colors=np.column_stack([color, np.ones(len(color))]),
        origin=scene.origin,
    )
    return mesh, hours.astype(np.float32)
