"""Key frames joined by splines: through the keys, with known values in between; files that are none."""

import numpy as np
import pytest

import umbrae as um
from umbrae.bench.case import Case, views
from umbrae.bench.flythrough import COLUMNS, FlyThrough
from umbrae.bench.scenes import SCENES, BenchScene

HEADER = ",".join(COLUMNS)
ROWS = ["0,0,0,0,0,0,-1,0,1,0", "1,1,4,0,1,0,-1,0,1,0", "2,4,4,1,1,0,0,0,1,0", "3,9,0,2,1,0,1,0,1,0"]


def flight(tmp_path, *lines):
    file = tmp_path / "flight.csv"
    file.write_text("\n".join(lines))
    return FlyThrough.load(file)


def test_the_spline_passes_through_its_keys(tmp_path):
    path = flight(tmp_path, HEADER, *ROWS)
    for time, key in zip(path.time, path.keys, strict=True):
        assert path.at(time) == pytest.approx(key, abs=1e-12)
    # Outside, the first and the last key.
    assert (path.at(-5) == path.keys[0]).all() and path.at(99) == pytest.approx(path.keys[-1], abs=1e-12)


def test_halfway_between_even_keys_is_catmull_and_roms_value(tmp_path):
    path = flight(tmp_path, HEADER, *ROWS)
    a, b, c, d = path.keys
    assert path.at(1.5) == pytest.approx((-a + 9 * b + 9 * c - d) / 16)
    # The first and last pieces start and end with the slope of their own chord.
    assert path.at(0.5) == pytest.approx((a + b) / 2 + (b - a) / 8 - (c - a) / 16)


def test_even_motion_stays_even_whatever_the_times(tmp_path):
    rows = [f"{t},{2 * t},0,{-t},0,0,-1,0,1,0" for t in (0.0, 0.5, 3.0, 10.0)]
    path = flight(tmp_path, HEADER, *rows)
    for time in np.linspace(0, 10, 23):
        assert path.at(time)[:3] == pytest.approx((2 * time, 0, -time))


def test_places_are_flown_between_in_even_times():
    path = FlyThrough.between("three", 16, [((0, 0, 0), (0, 0, -2)), ((4, 0, 0), (4, 1, 0)), ((8, 2, 0), (9, 2, 0))])
    assert path.time.tolist() == [0, 8, 16] and path.at(8).tolist() == [4, 0, 0, 0, 1, 0, 0, 1, 0]
    first, middle, last = path.cameras(3, 8, 6, near=0.5)
    assert (first.eye[0], middle.eye[0], last.eye[0], last.width, last.near) == (0, 4, 8, 8, 0.5)
    (only,) = path.cameras(1, 8, 6, near=0.5)
    assert (only.eye == middle.eye).all()


def test_two_keys_make_a_straight_line(tmp_path):
    path = flight(tmp_path, HEADER, ROWS[0], ROWS[1])
    assert path.at(0.25)[:2] == pytest.approx((0.25, 1.0))


def test_columns_may_stand_in_any_order_and_spreadsheets_may_mark_the_file(tmp_path):
    order = [3, 1, 2, 0, 4, 5, 6, 7, 8, 9]
    lines = [",".join(np.array(row.split(","))[order]) for row in (HEADER, *ROWS)]
    path = flight(tmp_path, "\ufeff" + lines[0].replace(",", ", "), *lines[1:], "", ",,,,,,,,,")
    assert path.keys == pytest.approx(flight(tmp_path, HEADER, *ROWS).keys)


def test_the_camera_flies(tmp_path):
    path = flight(tmp_path, HEADER, *ROWS)
    camera = path.camera(1 / 3, 32, 18, near=0.5)
    assert camera.eye == pytest.approx((1, 4, 0)) and (camera.width, camera.height, camera.near) == (32, 18, 0.5)
    assert camera.axes[2] == pytest.approx(np.array([1, 0, -1]) / 2**0.5)


def test_runs_are_the_frames_of_the_flight(tmp_path, monkeypatch):
    scene = um.Scene([(0, 0, 0), (8, 0, 0), (0, 0, 8)], [(0, 1, 2)])
    monkeypatch.setitem(SCENES, "tiny", BenchScene(lambda: scene))
    path = flight(tmp_path, HEADER, *ROWS)
    seen = views(Case("tiny", "point", 32, 18), scene, 4, path)
    # The warm-ups stand where the flight starts.
    assert [view.camera.eye.tolist() for view in seen] == [
        pytest.approx(key) for key in path.keys[[0, 0, 0, 1, 2, 3], :3].tolist()
    ]
    assert len({tuple(view.light.position) for view in seen}) == 6


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ((), "wanted the columns time,x,y,z"),
        (("time,x,y", "0,1,2"), "got time,x,y"),
        ((HEADER,), "two or more key frames, got 0"),
        ((HEADER, ROWS[0]), "two or more key frames, got 1"),
        ((HEADER, ROWS[0], "1,2"), "key frame 2: wanted 10 finite numbers, got '1,2'"),
        ((HEADER, ROWS[0], ROWS[1] + ",7"), "key frame 2: wanted 10 finite numbers"),
        ((HEADER, ROWS[0], ROWS[1].replace("4", "four")), "key frame 2: wanted 10 finite numbers"),
        ((HEADER, ROWS[0], ROWS[1].replace("4", "nan")), "key frame 2: wanted 10 finite numbers"),
        ((HEADER, ROWS[1], ROWS[0]), "times that grow, got 0 after 1"),
        ((HEADER, ROWS[0], ROWS[0]), "times that grow, got 0 after 0"),
        ((HEADER, ROWS[0], "1,0,0,0,0,0,0,0,1,0"), "the view direction at time 1 is zero"),
        ((HEADER, ROWS[0], "1,0,0,0,0,0,1,0,0,0"), "the up direction at time 1 is zero"),
    ],
)
def test_bad_files_end_in_one_line(tmp_path, lines, message):
    with pytest.raises(um.InputError) as caught:
        flight(tmp_path, *lines)
    assert message in str(caught.value) and "flight.csv" in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_files_that_are_no_text_or_not_there(tmp_path):
    with pytest.raises(um.InputError, match=r"no\.csv: cannot be read: No such file"):
        FlyThrough.load(tmp_path / "no.csv")
    with pytest.raises(um.InputError, match="cannot be read: Is a directory"):
        FlyThrough.load(tmp_path)
    (tmp_path / "a.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(um.InputError, match="is not a text"):
        FlyThrough.load(tmp_path / "a.csv")


def test_a_view_that_turns_through_zero_is_refused_where_it_does(tmp_path):
    path = flight(tmp_path, HEADER, ROWS[0], "1,1,4,0,0,0,1,0,1,0")
    with pytest.raises(um.InputError, match=r"turns through zero at time 0\.5"):
        path.camera(0.5, 32, 18, near=0.1)
