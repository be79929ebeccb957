"""Hours of sun against what geometry and almanacs say."""

import datetime as dt
import math

import numpy as np
import pytest

import umbrae as um
from umbrae.errors import CapacityError, InputError, OptionError
from umbrae.sun import Sky, day_times, legend_height, longitude_zone, sun_map, sun_study

LINZ = (48.3, 14.3)
HOUR, TEN_MINUTES = dt.timedelta(hours=1), dt.timedelta(minutes=10)
EMPTY = um.Scene(np.zeros((0, 3)), np.zeros((0, 3), int))


def at(text, latitude=LINZ[0], longitude=LINZ[1], **options):
    """The sky at one time in UTC."""
    return Sky.over([dt.datetime.fromisoformat(text + "+00:00")], latitude, longitude, step=HOUR, **options)


def towards(sky):
    """Unit vectors (n, 3) towards the sun in float64, of the float32 that every method uses."""
    rows = np.array([light.position[:3] for light in sky.lights], np.float64)
    return rows / np.linalg.norm(rows, axis=1)[:, None]


def day(date="2026-03-20", place=LINZ, step=TEN_MINUTES, **options):
    return Sky.over(day_times(date, step, longitude_zone(place[1])), *place, **options)


def box(low, high):
    """Twelve triangles around a box, wound outwards."""
    corners = [
        [(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)
    ]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]


def slabs(ray, points, low, high):
    """Whether rays from free points (n, 3) along `ray` meet a box: the slab test, in float64."""
    with np.errstate(divide="ignore"):
        near, far = (np.asarray(low) - points) / ray, (np.asarray(high) - points) / ray
    enter = np.minimum(near, far).max(axis=1)
    leave = np.maximum(near, far).min(axis=1)
    return np.maximum(enter, 0) < leave


# Where the sun stands


@pytest.mark.parametrize(
    ("when", "azimuth", "elevation"),
    [
        # Solar noon (equation of time -1.8, -1.5 and +2.2 minutes): elevation 90 - latitude + declination.
        ("2026-06-21T11:04:40", 180.0, 90 - 48.3 + 23.44),
        ("2026-12-21T11:00:50", 180.0, 90 - 48.3 - 23.44),
        # Sunrise at the equinox: due east, to within refraction along the sun's slanted path.
        ("2026-03-20T05:06:30", 89.5, 0.0),
    ],
)
def test_the_sun_stands_where_the_almanac_says(when, azimuth, elevation):
    sky = at(when)
    assert sky.azimuth[0] == pytest.approx(azimuth, abs=0.7)
    assert sky.elevation[0] == pytest.approx(elevation, abs=0.3)


def test_noon_is_south_in_the_north_and_north_in_the_south():
    up, south = 1, 2  # y, and +z
    (noon,) = towards(at("2026-06-21T11:04:40"))
    assert (
        noon[south] > 0.4 and abs(noon[0]) < 0.01 and noon[up] == pytest.approx(math.sin(math.radians(65.13)), abs=1e-3)
    )
    (sydney,) = towards(at("2026-06-21T02:00:00", -33.87, 151.2))
    assert sydney[south] < -0.5
    (rising,), (setting,) = towards(at("2026-03-20T05:20:00")), towards(at("2026-03-20T16:50:00"))
    assert rising[0] > 0.99 and setting[0] < -0.99


def test_north_turns_the_compass_clockwise():
    for when in ("2026-06-21T09:00:00", "2026-12-21T13:00:00"):
        (x, y, z), (turned,) = towards(at(when))[0], towards(at(when, north=90))
        # Geographic north along +x: east along +z, so what was at (east, south) = (x, z) comes to (-z, x).
        assert turned == pytest.approx((-z, y, x), abs=1e-6)
        (whole,) = towards(at(when, north=-270 + 720))
        assert whole == pytest.approx(turned, abs=1e-6)


def test_up_z_has_north_along_y():
    (x, y, z), (other,) = towards(at("2026-06-21T09:00:00"))[0], towards(at("2026-06-21T09:00:00", up=(0, 0, 1)))
    assert other == pytest.approx((x, -z, y), abs=1e-6)


# Times


def test_times_are_the_middles_of_steps_of_the_local_day():
    times = day_times("2026-06-21", HOUR, "Europe/Vienna")
    assert len(times) == 24 and times[0].isoformat() == "2026-06-21T00:30:00+02:00"
    assert times[-1].isoformat() == "2026-06-21T23:30:00+02:00"


@pytest.mark.parametrize(("date", "hours"), [("2026-03-29", 23), ("2026-10-25", 25), ("2026-06-21", 24)])
def test_days_on_which_clocks_change(date, hours):
    times = day_times(date, TEN_MINUTES, "Europe/Vienna")
    assert len(times) == 6 * hours
    assert {one.date().isoformat() for one in times} == {date}
    # Also where the times of one zone look unequal: their distance is that of real time.
    assert Sky.over(times, *LINZ).step_hours == pytest.approx(1 / 6)


def test_a_step_that_does_not_divide_the_day_is_shortened():
    times = day_times("2026-06-21", dt.timedelta(minutes=7))
    assert len(times) == 206
    assert Sky.over(times, *LINZ).step_hours * 206 == pytest.approx(24)


def test_zones_by_longitude():
    assert [longitude_zone(lon).utcoffset(None) / HOUR for lon in (14.3, -74, 0, 180, -180)] == [1, -5, 0, 12, -12]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: day_times("2026-02-30"), "date: wanted a date YYYY-MM-DD that exists, got '2026-02-30'"),
        (lambda: day_times("tomorrow"), "date: wanted"),
        (lambda: day_times(20260621), "date: wanted date, got int"),
        (lambda: day_times("0001-01-01"), "date: wanted a year from 1000 to 3000, got 1"),
        (lambda: day_times("2026-06-21", TEN_MINUTES, "Europe/Wien"), "got 'Europe/Wien'"),
        (lambda: day_times("2026-06-21", TEN_MINUTES, "../etc/passwd"), "timezone: wanted"),
        (lambda: day_times("2026-06-21", TEN_MINUTES, "Europe"), "timezone: wanted"),
        (lambda: day_times("2026-06-21", TEN_MINUTES, ""), "timezone: wanted"),
        (lambda: day_times("2026-06-21", TEN_MINUTES, 1), "timezone: wanted"),
        (lambda: day_times("2011-12-30", TEN_MINUTES, "Pacific/Apia"), "does not exist in Pacific/Apia"),
        (lambda: day_times("2026-06-21", dt.timedelta()), "step: wanted"),
        (lambda: day_times("2026-06-21", dt.timedelta(hours=-1)), "step: wanted"),
        (lambda: day_times("2026-06-21", dt.timedelta(hours=25)), "step: wanted"),
        (lambda: day_times("2026-06-21", 10), "step: wanted timedelta, got int"),
        (lambda: at("2026-06-21T11:00:00", latitude=90.1), "latitude: wanted -90 to 90 degrees north, got 90.1"),
        (lambda: at("2026-06-21T11:00:00", longitude=math.nan), "longitude: wanted a finite number"),
        (lambda: at("2026-06-21T11:00:00", longitude=-181), "longitude: wanted"),
        (lambda: at("2026-06-21T11:00:00", north=math.inf), "north: wanted a finite number"),
        (lambda: at("2026-06-21T11:00:00", up=(1, 0, 0)), "up: wanted y or z"),
        (lambda: at("0999-06-21T11:00:00"), "times: wanted years 1000 to 3000"),
        (lambda: Sky.over([dt.datetime(2026, 6, 21)], *LINZ), "wanted times with a time zone"),
        (lambda: Sky.over([1.5], *LINZ), "times: wanted datetime, got float"),
        (lambda: Sky.over(day_times("2026-06-21")[:1], *LINZ), "step: needed with 1 times"),
        (lambda: Sky.over([], *LINZ), "step: needed with 0 times"),
        (lambda: Sky.over(day_times("2026-06-21")[::-1], *LINZ), "step: needed"),
        (lambda: Sky.over([day_times("2026-06-21")[i] for i in (0, 1, 5)], *LINZ), "not equally spaced"),
        (lambda: Sky.over(day_times("2026-06-21"), *LINZ, step=dt.timedelta()), "step: wanted a time > 0"),
    ],
)
def test_what_cannot_be_is_one_clear_line(call, message):
    with pytest.raises(InputError) as caught:
        call()
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_without_pvlib_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pvlib.solarposition", None)
    with pytest.raises(OptionError, match=r"pip install 'umbrae\[sun\]'"):
        day()


# Hours


def test_in_the_open_all_of_the_day_counts():
    sky = day("2026-03-20")
    study = sun_study(EMPTY, um.ViewSamples.points([(0, 0, 0), (5, 5, 5)]), sky)
    # 12 hours, refraction and half of the sun's daily motion in declination: seven to ten minutes more.
    assert 12.0 <= sky.possible_hours < 12.35
    assert study.hours.tolist() == [sky.possible_hours] * 2 and study.lit.tolist() == [1, 1]
    assert study.guarantee is um.Guarantee.EXACT


def test_the_year_has_the_days_it_should():
    longest, shortest = day("2026-06-21").possible_hours, day("2026-12-21").possible_hours
    # Linz: 16:08 and 8:17 between sunrise and sunset of the upper limb, about 10 minutes less for the centre.
    assert longest == pytest.approx(16.0, abs=0.2) and shortest == pytest.approx(8.2, abs=0.2)


@pytest.mark.parametrize(("date", "hours"), [("2026-06-21", 24.0), ("2026-12-21", 0.0)])
def test_polar_day_and_night(date, hours):
    sky = day(date, (78.2, 15.6))
    study = sun_study(EMPTY, um.ViewSamples.points([(0, 0, 0)]), sky)
    assert sky.possible_hours == pytest.approx(hours) and study.hours[0] == pytest.approx(hours)
    assert study.lit[0] == (1.0 if hours else 0.0)


def test_finer_steps_converge_to_the_length_of_the_day():
    """Middles of steps: no drift with the step, only rounding at sunrise and sunset."""
    exact = day("2026-05-05", step=dt.timedelta(minutes=1)).possible_hours
    for minutes in (5, 10, 30, 60):
        hours = day("2026-05-05", step=dt.timedelta(minutes=minutes)).possible_hours
        assert abs(hours - exact) <= 2 * minutes / 60 / 2 + 1 / 60


def test_the_parts_of_a_day_add_up():
    scene = um.Scene(*box((-1, 0, -1), (1, 3, 1)))
    points = um.ViewSamples.points(np.random.default_rng(3).uniform((-6, 0, -6), (6, 1, 6), (300, 3)))
    times = day_times("2026-04-10", dt.timedelta(minutes=30), "UTC")
    step = dt.timedelta(minutes=30)
    parts = [um.sun_hours(scene, points, some, *LINZ, step=step).hours for some in (times[:20], times[20:])]
    assert np.allclose(sum(parts), um.sun_hours(scene, points, times, *LINZ).hours, atol=1e-12)
    assert len(np.unique(sum(parts))) > 5


def test_opposite_faces_share_the_day():
    """Two sides of one sheet in the open: the sun is on one of them, never on both."""
    scene = um.Scene([(0, 0, 0), (1, 0, 0.3), (0, 1, 0)], [(0, 1, 2)])
    sky = day("2026-06-21")
    front, back = (
        sun_study(scene, um.ViewSamples.on_surface(scene, [0], [(0.3, 0.3)], side), sky).hours[0] for side in (1, -1)
    )
    assert front > 0 and back > 0 and front + back == pytest.approx(sky.possible_hours)


def test_a_pole_is_a_sundial():
    """Sensors around a thin pole are dark just when the pole stands between them and the sun."""
    low, high = (-0.05, 0.0, -0.05), (0.05, 4.0, 0.05)
    scene = um.Scene(*box(low, high))
    angle, radius = np.meshgrid(np.linspace(0, 2 * np.pi, 90, endpoint=False) + 0.01, [0.5, 1.1, 2.3, 4.7, 9.1])
    points = np.stack([radius * np.cos(angle), np.full_like(angle, 0.125), radius * np.sin(angle)], -1).reshape(-1, 3)
    points = points.astype(np.float32).astype(np.float64)
    sky = day("2026-04-10")
    dark = np.zeros(len(points), int)
    for ray in towards(sky)[sky.is_day]:
        dark += slabs(ray, points, low, high)
    hours = sun_study(scene, um.ViewSamples.points(points), sky).hours
    assert dark.max() >= 3 and 0.05 < (dark > 0).mean() < 0.9
    assert np.allclose(hours, sky.possible_hours - dark * sky.step_hours)


def test_an_endless_wall():
    """North of a wall along east and west: sun while its profile angle is higher than the wall's, or from the north."""
    height = 3.0
    scene = um.Scene([(-1e6, 0, 0), (1e6, 0, 0), (1e6, height, 0), (-1e6, height, 0)], [(0, 1, 2), (0, 2, 3)])
    distance = np.linspace(0.5, 12, 24).astype(np.float32)
    points = np.stack([np.zeros(24), np.full(24, 0.25), -distance], 1)
    sky = day("2026-05-05")
    _, y, z = towards(sky)[sky.is_day].T
    hidden = (z > 0)[:, None] & (np.arctan2(y, z)[:, None] < np.arctan2(height - 0.25, distance)[None, :])
    hours = sun_study(scene, um.ViewSamples.points(points), sky).hours
    assert np.allclose(hours, (~hidden).sum(axis=0) * sky.step_hours)
    assert (np.diff(hours) >= 0).all() and hours[0] + 5 < hours[-1]


def test_a_courtyard():
    """The ground inside four walls: per sun, dark where the point at the walls' height lies outside the court."""
    half, height = 5.0, 6.0
    corners = [(-half, -half), (half, -half), (half, half), (-half, half)]
    positions = [(x, y, z) for x, z in corners for y in (0, height)]
    walls = [(2 * i, 2 * i + 1, (2 * i + 3) % 8) for i in range(4)] + [
        (2 * i, (2 * i + 3) % 8, (2 * i + 2) % 8) for i in range(4)
    ]
    ground = [(8, 10, 9), (8, 11, 10)]
    scene = um.Scene(positions + [(x, 0, z) for x, z in corners], walls + ground)
    rng = np.random.default_rng(5)
    uv = np.sort(rng.random((400, 2)), axis=1)
    uv = np.stack([uv[:, 0], uv[:, 1] - uv[:, 0]], 1)
    sensors = um.ViewSamples.on_surface(scene, rng.integers(8, 10, 400), uv)
    sky = day("2026-06-21")
    place = sensors.position.astype(np.float64)
    lit = np.zeros(400, int)
    for ray in towards(sky)[sky.is_day]:
        out = place[:, [0, 2]] + ray[[0, 2]] * height / ray[1]
        lit += (np.abs(out) < half).all(axis=1)
    hours = sun_study(scene, sensors, sky).hours
    assert np.allclose(hours, lit * sky.step_hours)
    assert hours.min() < 1 and hours.max() > 5
    assert hours[place[:, 2] < 0].mean() > hours[place[:, 2] > 0].mean() + 1, "the north side is the sunny one"


def test_the_order_of_sensors_does_not_matter():
    scene = um.Scene(*box((-1, 0, -1), (1, 3, 1)))
    points = np.random.default_rng(4).uniform((-6, 0, -6), (6, 1, 6), (500, 3)).astype(np.float32)
    shuffle = np.random.default_rng(5).permutation(500)
    sky = day("2026-04-10", step=HOUR)
    hours = sun_study(scene, um.ViewSamples.points(points), sky).hours
    assert (sun_study(scene, um.ViewSamples.points(points[shuffle]), sky).hours == hours[shuffle]).all()
    shaped = sun_study(scene, um.ViewSamples.points(points.reshape(20, 25, 3)), sky).hours
    assert (shaped == hours.reshape(20, 25)).all() and len(np.unique(hours)) > 3


def test_no_sensors_are_no_error():
    assert sun_study(EMPTY, um.ViewSamples.points([]), day()).hours.shape == (0,)


def test_progress_counts_the_suns():
    sky, clock = day("2026-06-21", step=HOUR), um.Clock()
    seen = []
    clock.advance = lambda done, total: seen.append((done, total))
    sun_study(um.Scene(*box((0, 0, 0), (1, 1, 1))), um.ViewSamples.points([(2, 0, 0)]), sky, clock=clock)
    suns = int(sky.is_day.sum())
    assert seen[-suns:] == [(done, suns) for done in range(1, suns + 1)]
    assert [name for name, _ in clock.spans] == ["prepare", "sun"]


def test_too_many_points_are_refused_beforehand(monkeypatch):
    monkeypatch.setattr("umbrae.memory.available_bytes", lambda: 1000)
    with pytest.raises(CapacityError, match="a study of 100 points needs"):
        sun_study(EMPTY, um.ViewSamples.points(np.zeros((100, 3))), day())


def test_points_of_another_scene_are_refused():
    scene = um.Scene(*box((0, 0, 0), (1, 1, 1)))
    with pytest.raises(InputError, match="another scene"):
        sun_study(EMPTY, um.ViewSamples.on_surface(scene, [0], [(0.3, 0.3)]), day())
    with pytest.raises(InputError, match="sensors: wanted ViewSamples, got list"):
        um.sun_hours(scene, [(0, 0, 0)], day_times("2026-06-21"), *LINZ)


# The picture


def test_a_pixel_shows_its_own_hours():
    scene = um.Scene(*box((-1, 0, -1), (1, 1, 1)))
    camera = um.Camera.look_at((3, 3, 4), (0, 0.5, 0), width=60, height=40)
    sky = day("2026-03-20", step=HOUR)
    image, study = sun_map(scene, camera, sky, samples_per_pixel=4)
    assert image.pixels.shape == (40 + legend_height(60), 60, 3) and study.hours.shape == (80, 120)
    covered = image.samples.covered
    assert np.isnan(study.hours[~covered]).all() and not np.isnan(study.hours[covered]).any()
    # A box in the open: the roof has all of the day, each wall what its side of the sky has.
    rays = towards(sky)[sky.is_day]
    for axis in range(3):
        face = covered & (np.abs(image.samples.position[..., axis] - 1) < 1e-5)
        wall = (rays[:, axis] > 0).sum() * sky.step_hours
        inner = face & (np.abs(image.samples.position) < 1.0001).all(axis=-1)
        assert inner.sum() > 200 and np.median(study.hours[inner]) == pytest.approx(wall)
    hours = study.hours.reshape(40, 2, 60, 2).mean(axis=(1, 3))
    bright = image.pixels[:40].astype(int).sum(axis=2)
    assert bright[hours == np.nanmax(hours)].mean() > bright[hours == np.nanmin(hours)].mean() + 100


@pytest.mark.parametrize("count", [0, -4, 2, 8])
def test_pixels_are_split_in_squares(count):
    with pytest.raises(OptionError, match="wanted a square number"):
        sun_map(EMPTY, um.Camera.look_at((0, 0, 1), (0, 0, 0), width=8, height=8), day(), samples_per_pixel=count)


@pytest.mark.parametrize(("width", "date"), [(8, "2026-06-21"), (200, "2026-12-21"), (2000, "2026-03-20")])
def test_the_legend_fits_any_width(width, date):
    from umbrae.sun.legend import BACKGROUND, legend

    strip = legend(width, day(date, (78.2, 15.6)))
    assert strip.shape == (legend_height(width), width, 3)
    if width >= 200:
        assert (strip[:, :3] == BACKGROUND).all() and (strip[:, -3:] == BACKGROUND).all(), "nothing is cut off"


def test_ticks_are_round():
    from umbrae.sun.legend import ticks

    assert ticks(12.0) == [0, 2, 4, 6, 8, 10, 12.0]
    assert ticks(16.2) == [0, 3, 6, 9, 12, 16.2]
    assert ticks(24.0) == [0, 3, 6, 9, 12, 15, 18, 21, 24] and ticks(0.0) == [0]
    assert ticks(1 / 6)[-1] == 1 / 6
