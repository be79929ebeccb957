"""Sensors on faces, and the files a study leaves behind."""

import csv
import datetime as dt

import numpy as np
import pygltflib
import pytest
import trimesh

import umbrae as um
from umbrae import models
from umbrae.errors import CapacityError, InputError, OutputError
from umbrae.sun import Sky, both_sides, day_times, save_study, sun_study, sunnier, surface_sensors
from umbrae.sun.sensors import facets


def square(width=4.0, height=3.0, move=(0, 0, 0), tilt=0.0):
    """Two triangles around one rectangle, leaning back by `tilt` degrees."""
    flat = np.array([(0, 0, 0), (width, 0, 0), (width, height, 0), (0, height, 0)], float)
    cos, sin = np.cos(np.radians(tilt)), np.sin(np.radians(tilt))
    turned = flat @ np.array([(1, 0, 0), (0, cos, -sin), (0, sin, cos)])
    return um.Scene(turned + move, [(0, 1, 2), (0, 2, 3)])


def winter_day(hours=2):
    return Sky.over(day_times("2026-12-21", dt.timedelta(hours=hours), "Europe/Vienna"), 48.3, 14.3)


def test_one_sensor_in_the_middle_of_each_face():
    scene = um.Scene([(0, 0, 0), (3, 0, 0), (0, 3, 0), (6, 0, 0)], [(0, 1, 2), (0, 1, 3), (2, 1, 0)])
    sensors = surface_sensors(scene)
    assert sensors.triangle.tolist() == [0, 2], "the triangle without an area has no middle to shine on"
    assert np.allclose(sensors.position, [(1, 1, 0)] * 2) and sensors.side.tolist() == [1, 1]
    assert surface_sensors(scene, side=-1).side.tolist() == [-1, -1]


@pytest.mark.parametrize("tilt", [0, 90, 33])
@pytest.mark.parametrize("move", [(0, 0, 0), (0.125, -7.25, 3.5)])
def test_a_grid_covers_a_wall_evenly(tilt, move):
    """No gap and no point twice along the diagonal that the two triangles of the wall share."""
    sensors = surface_sensors(square(4, 3, move, tilt), 0.25)
    assert sensors.size == pytest.approx(16 * 12, rel=0.12)
    apart = np.linalg.norm(sensors.position[:, None] - sensors.position[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    assert np.allclose(apart.min(axis=1), 0.25, atol=1e-5)
    if not any(move) and tilt == 0:
        assert sensors.size == 192
        assert (np.diff(sensors.triangle) >= 0).all(), "face by face"


def test_a_grid_counts_areas():
    scene = models.pavilion()
    area = facets(scene)[1]
    sensors = surface_sensors(scene, 0.2)
    large = area > 0.5
    per_face = np.bincount(sensors.triangle, minlength=len(area))
    assert (per_face[area > 0] >= 1).all()
    assert per_face[large].sum() * 0.2**2 == pytest.approx(area[large].sum(), rel=0.02)


def test_small_faces_keep_a_sensor():
    sensors = surface_sensors(square(0.01, 0.01), 5.0)
    assert sensors.triangle.tolist() == [0, 1]


@pytest.mark.parametrize("spacing", [0, -1, np.nan, np.inf, "wide"])
def test_spacings_that_cannot_be(spacing):
    with pytest.raises(InputError, match="spacing: wanted"):
        surface_sensors(square(), spacing)


def test_a_grid_too_fine_says_what_would_fit(monkeypatch):
    with pytest.raises(
        CapacityError, match=r"a grid of sensors with a spacing of 1e-06 \(\S+ would fit\) needs \S+ GiB"
    ):
        surface_sensors(square(), 1e-6)
    monkeypatch.setattr("umbrae.memory.available_bytes", lambda: 10_000_000)
    monkeypatch.setattr("umbrae.sun.sensors.available_bytes", lambda: 10_000_000)
    with pytest.raises(CapacityError) as refused:
        surface_sensors(square(), 0.01)
    fits = float(str(refused.value).split("(")[1].split()[0])
    assert surface_sensors(square(), fits).size > 1000
    with pytest.raises(InputError, match="too fine for coordinates"):
        surface_sensors(square(move=(1e5, 0, 0)), 1e-12)


def test_nothing_to_shine_on():
    for scene in (um.Scene([], []), um.Scene([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)])):
        with pytest.raises(InputError, match="no face with an area"):
            surface_sensors(scene)
    with pytest.raises(InputError, match="side: wanted 1 or -1, got 0"):
        surface_sensors(square(), side=0)


def test_the_sunnier_side_does_not_depend_on_the_winding():
    """A solid whose faces are wound at random has the hours of its outside everywhere."""
    scene = models.sphere(3)
    flip = np.random.default_rng(1).random(len(scene.triangles)) < 0.5
    shuffled = um.Scene(scene.positions, np.where(flip[:, None], scene.triangles[:, ::-1], scene.triangles))
    sky = winter_day()
    outside = sun_study(scene, surface_sensors(scene), sky)
    sensors = both_sides(surface_sensors(shuffled))
    sensors, study = sunnier(sensors, sun_study(shuffled, sensors, sky))
    assert (study.hours == outside.hours).all() and len(np.unique(study.hours)) > 2
    lit = outside.hours > 0
    assert (sensors.side[lit] == np.where(flip, -1, 1)[lit]).all()


def study_of(scene, spacing=None):
    sensors = surface_sensors(scene, spacing)
    return sensors, sun_study(scene, sensors, winter_day())


def test_arrays_and_table_hold_every_sensor(tmp_path):
    scene = square(4, 3)
    sensors, study = study_of(scene, 0.5)
    save_study(tmp_path / "s.npz", scene, sensors, study)
    save_study(tmp_path / "s.csv", scene, sensors, study)
    with np.load(tmp_path / "s.npz") as arrays:
        assert (arrays["hours"] == study.hours).all() and (arrays["position"] == sensors.position).all()
        assert arrays["area"].sum() == pytest.approx(12) and arrays["normal"][0].tolist() == [0, 0, 1]
        assert arrays["times"][0] == np.datetime64("2026-12-21T00:00") and len(arrays["directions"]) == 12
    with open(tmp_path / "s.csv") as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0]) == ["face", "x", "y", "z", "nx", "ny", "nz", "area", "hours"] and len(rows) == 48
    assert [float(row["hours"]) for row in rows] == study.hours.tolist()
    assert [int(row["face"]) for row in rows] == sensors.triangle.tolist()
    assert np.allclose([[float(row[axis]) for axis in "xyz"] for row in rows], sensors.position, rtol=1e-6)


def test_places_are_in_the_coordinates_of_the_file(tmp_path):
    origin = (5_000_000.25, 0, 0)
    local = square(4, 3)
    scene = um.Scene(local.positions, local.triangles, origin=origin)
    sensors, study = study_of(scene)
    save_study(tmp_path / "s.csv", scene, sensors, study)
    first = (tmp_path / "s.csv").read_text().splitlines()[1].split(",")
    assert float(first[1]) == pytest.approx(5_000_000.25 + 8 / 3, abs=1e-4)


@pytest.mark.parametrize("extension", ["ply", "glb"])
def test_models_carry_hours_as_colour_and_number(tmp_path, extension):
    """A wall that faces south, and one back to back with it."""
    scene = um.Scene([(0, 0, 0), (4, 0, 0), (4, 3, 0), (0, 3, 0)], [(0, 1, 2), (0, 2, 3), (2, 1, 0), (3, 2, 0)])
    sensors, study = study_of(scene, 0.5)
    path = tmp_path / f"s.{extension}"
    save_study(path, scene, sensors, study)
    mesh = trimesh.load_mesh(path, process=False)
    if extension == "ply":
        hours = np.asarray(mesh.metadata["_ply_raw"]["vertex"]["data"]["hours"])
    else:
        assert pygltflib.GLTF2().load(path).meshes[0].primitives[0].attributes._HOURS is not None
        hours = mesh.vertex_attributes["_HOURS"]
    assert np.allclose(hours.reshape(-1, 3), [[8.0] * 3] * 2 + [[0.0] * 3] * 2)
    back = um.load(path)
    assert np.allclose(back.positions[back.triangles], scene.positions[scene.triangles])
    bright = back.colors[back.triangles][:, :, :3].sum(axis=2)
    assert bright[:2].min() > bright[2:].max() + 1


def test_scalars_need_a_format_that_keeps_them(tmp_path):
    scene = square()
    with pytest.raises(OutputError, match=r"unknown extension '.stl'"):
        um.save(scene, tmp_path / "s.stl", {"hours": np.zeros(4, np.float32)})
    with pytest.raises(InputError, match=r"save: hours: wanted \(4,\) float32"):
        um.save(scene, tmp_path / "s.ply", {"hours": np.zeros(3, np.float32)})
    assert not list(tmp_path.iterdir())


def test_other_files_are_refused(tmp_path):
    scene = square()
    with pytest.raises(OutputError, match=r"wanted one of \.npz \.csv \.glb \.ply"):
        save_study(tmp_path / "s.txt", scene, *study_of(scene))


def test_spacings_beyond_all_numbers():
    # Wider than any face: still a sensor on each. Next to nothing: refused, not divided by.
    assert surface_sensors(square(), 1e300).size == 2
    with pytest.raises(InputError, match="too fine"):
        surface_sensors(square(), 1e-320)
