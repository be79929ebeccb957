"""Figures of shadow volumes: each count has its colour, layers and lines lie where they should."""

import numpy as np
import pytest
from PIL import Image

import umbrae as um
from umbrae import cli, show
from umbrae.show import PALETTE, legend_height, silhouette_lines

WHITE = np.full((8, 64, 3), 255, np.uint8)


def color_of(index):
    """On a white picture."""
    return np.round(PALETTE[index] * 0.92 + 20).astype(np.uint8)


def test_each_count_has_its_color_and_background_has_none():
    counts = np.zeros((8, 64), np.int32)
    counts[:, 8:16], counts[:, 16:24], counts[:, 40:] = 1, 8, 3
    covered = np.ones((8, 64), bool)
    covered[:, 40:] = False
    pixels = show.count(WHITE, counts, covered).pixels
    assert pixels.shape == (8 + legend_height(64), 64, 3)
    np.testing.assert_array_equal(pixels[0, [0, 40]], [[255] * 3] * 2)
    np.testing.assert_array_equal(pixels[0, [8, 16]], [color_of(0), color_of(7)])


def test_colors_stand_for_more_than_one_count_where_there_are_many():
    counts = np.arange(64, dtype=np.int32)[None].repeat(8, axis=0)
    covered = counts < 41
    pixels = show.count(WHITE, counts, covered).pixels[0]
    for index, (low, high) in enumerate([(1, 1), (2, 2), (3, 3), (4, 4), (5, 7), (8, 15), (16, 31), (32, 40)]):
        assert (pixels[low : high + 1] == color_of(index)).all()
    legend = show.count(np.repeat(WHITE, 10, axis=1), np.repeat(counts, 10, 1), np.repeat(covered, 10, 1)).pixels[8:]
    for color in PALETTE:
        assert (legend == color.astype(np.uint8)).all(axis=2).any(), "every colour that occurs is in the legend"


def test_colors_that_do_not_occur_are_not_in_the_legend():
    counts = np.full((8, 640), 2, np.int32)
    legend = show.count(np.repeat(WHITE, 10, axis=1), counts, counts > 0).pixels[8:]
    seen = [(legend == color.astype(np.uint8)).all(axis=2).any() for color in PALETTE]
    assert seen == [True, True, *[False] * 6] and not (legend == 0).all(axis=2).any()
    counts[0, 0] = -1
    below = show.count(np.repeat(WHITE, 10, axis=1), counts, counts != 0).pixels
    assert (below[0, 0] == 0).all() and (below[8:] == 0).all(axis=2).any()


def test_a_finer_picture_is_averaged():
    counts = np.zeros((16, 128), np.int32)
    counts[::2] = 1
    pixels = show.count(WHITE.repeat(2, 0).repeat(2, 1), counts, np.ones((16, 128), bool), 2).pixels
    assert pixels.shape == (8 + legend_height(64), 64, 3)
    np.testing.assert_allclose(pixels[0, 0], (color_of(0) + 255.0) / 2, atol=1)


@pytest.mark.parametrize("width", [1, 30, 5000])
def test_legends_of_any_width(width):
    picture = np.full((3, width, 3), 200, np.uint8)
    pixels = show.count(picture, np.full((3, width), 50, np.int32), np.ones((3, width), bool)).pixels
    assert pixels.shape == (3 + legend_height(width), width, 3)


def test_layers_cover_more_and_more_but_never_all():
    faces = np.array([[0, 1, 2, 5, 50, 5000]], np.int32)
    picture = np.zeros((1, 6, 3), np.uint8)
    nothing = np.zeros((1, 6), np.int32)
    seen = show.volumes(picture, faces, nothing, nothing > 0, nothing == 0).pixels[0].astype(int)
    behind = show.volumes(picture, faces, nothing, nothing > 0, nothing > 0).pixels[0].astype(int)
    assert (np.diff(seen[:, 0]) >= 0).all() and (np.diff(seen[:4, 0]) > 10).all()
    assert seen[-1, 0] < 230, "what lies behind is still there"
    assert (behind[1:, 0] < seen[1:, 0]).all(), "fainter before the background"
    np.testing.assert_array_equal(seen[0], behind[0])


def test_edges_and_silhouettes_are_drawn():
    nothing = np.zeros((60, 60), np.int32)
    edges, silhouettes = nothing.copy(), nothing > 0
    edges[:, 20], silhouettes[:, 40] = 1, True
    picture = np.full((60, 60, 3), 255, np.uint8)
    pixels = show.volumes(picture, nothing, edges, silhouettes, nothing == 0).pixels
    changed = (pixels != 255).any(axis=2)
    assert changed[:, [20, 40]].all() and changed.sum() == 120
    red, green, _ = pixels[30, 40].astype(int)
    assert red > green + 80 and (pixels[30, 40, 1] < pixels[30, 20, 1]).all()


CAMERA = um.Camera.look_at((0, 0, 10), (0, 0, 0), fov_y=2 * np.degrees(np.arctan(0.5)), width=40, height=20)
"""Sees x from -10 to 10 and y from -5 to 5 at z = 0, half a unit a pixel."""
FAR = np.full((20, 40), np.inf, np.float32)


def lines(*edges, depth=FAR, thickness=1):
    ends = np.array(edges, np.float32).reshape(-1, 2, 3)
    return silhouette_lines(ends, CAMERA.world_to_clip, CAMERA.near, depth, thickness)


def test_a_silhouette_is_drawn_where_it_is():
    drawn = lines([(-2, 1.25, 0), (3, 1.25, 0)])
    assert sorted(set(np.flatnonzero(drawn.any(axis=1)))) == [7]
    assert np.flatnonzero(drawn[7]).tolist() == list(range(16, 26))
    slanted = lines([(-9.75, -4.75, 0), (9.75, 4.75, 0)])
    assert slanted.any(axis=0).all() and slanted[19, 0] and slanted[0, 39]
    assert lines([(-2, 1.25, 0), (3, 1.25, 0)], thickness=2).sum() == 2 * 11
    assert not lines().any()


def test_a_silhouette_is_hidden_by_what_is_nearer():
    wall = FAR.copy()
    wall[:, 20:] = 9
    drawn = lines([(-5, 1.25, 0), (5, 1.25, 0)], depth=wall)
    assert np.flatnonzero(drawn[7]).tolist() == list(range(10, 21)), "one sample further"
    at_the_edge = np.full((20, 40), 10, np.float32)
    assert lines([(-5, 1.25, 0), (5, 1.25, 0)], depth=at_the_edge).sum() == 20, "its own surface does not hide it"


def test_silhouettes_behind_the_eye_and_beside_the_picture_are_cut():
    assert not lines([(0, 1, 11), (0, 1, 20)], [(30, 0, 0), (40, 9, 0)]).any()
    crossing = lines([(0.25, -2, 0), (0.25, -2, 100)])
    assert np.flatnonzero(crossing.any(axis=0)).tolist() == [20, 21]
    assert np.flatnonzero(crossing.any(axis=1)).tolist() == list(range(14, 20))
    assert lines([(-1e6, 0.25, 0), (1e6, 0.25, 0)]).sum() == 40


@pytest.mark.parametrize("kind", ["count", "volumes"])
def test_on_the_command_line(kind, tmp_path, monkeypatch, capsys, opengl):
    monkeypatch.chdir(tmp_path)
    floor = [(-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2)]
    roof = [(-1, 1, 1), (1, 1, 1), (1, 1, -1), (-1, 1, -1)]
    um.save(um.Scene(floor + roof, [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)]), "roof.glb")
    texts = f"render roof.glb --size 96x60 --sun 120,50 --method silhouette-cpu --samples-per-pixel 4 -q --show {kind}"
    assert cli.run(texts.split()) == 0
    assert capsys.readouterr().out == "roof.png\n"
    with Image.open("roof.png") as opened:
        picture = np.asarray(opened).astype(int)
    assert picture.shape == (60, 96, 3)
    warm, blue = picture[..., 0] - picture[..., 2], picture[..., 2] - picture[..., 0]
    if kind == "count":
        assert (blue[: 60 - legend_height(96)] > 40).sum() > 100, "one volume: blue"
    else:
        assert (warm > 40).sum() > 200, "layers: amber"
        assert (picture[..., 0] - picture[..., 1] > 60).any(), "silhouettes: red"
