"""Sun hours beside ray casting: the comparators count what the exact study counts."""

import datetime as dt
from pathlib import Path

import numpy as np
import pytest

import umbrae as um
from umbrae import models
from umbrae.bench.embree import EmbreexRunner
from umbrae.bench.runner import MethodRunner
from umbrae.bench.sun import run_sun
from umbrae.sun import Sky, day_times, surface_sensors

CITY = Path(__file__).parents[2] / "shared" / "scenes" / "city" / "linz-center-2km.glb"


def sky(hours):
    return Sky.over(day_times("2026-04-20", dt.timedelta(hours=hours), "Europe/Vienna"), 48.3, 14.3)


def some_sensors(scene, count):
    sensors = surface_sensors(scene)
    return sensors.take(np.sort(np.random.default_rng(7).choice(sensors.size, count, replace=False)))


class Absent(MethodRunner):
    def unavailable(self):
        return "not here"


def test_the_oracle_counts_the_same():
    scene = models.pavilion()
    method = um.METHODS["oracle"]()
    runs = run_sun(scene, some_sensors(scene, 40), sky(6), [MethodRunner(method), Absent(method)], um.Clock())
    assert [(run.name, run.differ, run.stopped) for run in runs] == [
        ("umbrae", 0, None),
        ("oracle", 0, None),
        ("oracle", 0, "not here"),
    ]
    assert runs[0].seconds > 0 and runs[1].seconds > 0 == runs[2].seconds


@pytest.mark.skipif(bool(EmbreexRunner().unavailable()), reason="embreex is not installed")
@pytest.mark.skipif(not CITY.exists(), reason="the city is not here")
def test_embree_agrees_but_for_its_offset():
    scene = um.load(CITY)
    count, day = 5000, sky(3)
    runs = run_sun(scene, some_sensors(scene, count), day, [EmbreexRunner()], um.Clock())
    assert 0 <= runs[1].differ <= 1e-3 * count * day.is_day.sum()
