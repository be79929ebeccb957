"""Bilinear look-up of packed textures."""

import numpy as np
import pytest

from umbrae.geometry.texture import SRGB_TO_LINEAR, fetch, pack


def test_srgb_is_decoded() -> None:
    assert SRGB_TO_LINEAR[0] == 0 and SRGB_TO_LINEAR[255] == 1
    # IEC 61966-2-1: linear below 0.04045, middle grey 188 is half the light.
    assert SRGB_TO_LINEAR[10] == pytest.approx(10 / 255 / 12.92)
    assert SRGB_TO_LINEAR[188] == pytest.approx(0.5029, abs=1e-4)


def corners() -> np.ndarray:
    """2 x 2: white, red over green, blue; alpha 0, 51, 102, 255."""
    return np.array([[[255, 255, 255, 0], [255, 0, 0, 51]], [[0, 255, 0, 102], [0, 0, 255, 255]]], np.uint8)


@pytest.mark.parametrize(
    ("u", "v", "expected"),
    [
        (0.25, 0.25, (1, 1, 1, 0)),
        (0.75, 0.25, (1, 0, 0, 0.2)),
        (0.25, 0.75, (0, 1, 0, 0.4)),
        (0.75, 0.75, (0, 0, 1, 1)),
        (0.5, 0.25, (1, 0.5, 0.5, 0.1)),
        (0.5, 0.5, (0.5, 0.5, 0.5, 0.4)),
        (0.0, 0.25, (1, 0.5, 0.5, 0.1)),  # between the last and the first texel
        (1.0, 0.25, (1, 0.5, 0.5, 0.1)),
        (-1e-20, 0.25, (1, 0.5, 0.5, 0.1)),
        (-3.75, 7.25, (1, 1, 1, 0)),
    ],
)
def test_bilinear_and_repeated(u: float, v: float, expected: tuple[float, ...]) -> None:
    textures = pack([None, corners()])
    assert fetch(*textures, 1, u, v) == pytest.approx(expected)


def test_slots() -> None:
    first, second = np.full((1, 1, 4), 255, np.uint8), np.zeros((3, 5, 4), np.uint8)
    textures = pack([first, None, second, first])
    assert textures.texels.size == first.size + second.size  # stored once
    assert textures.size.tolist() == [[1, 1], [0, 0], [3, 5], [1, 1]]
    assert fetch(*textures, 1, 0.3, 0.3) == (1, 1, 1, 1)
    assert fetch(*textures, 2, 0.3, 0.3) == (0, 0, 0, 0)
    assert fetch(*textures, 3, 0.3, 0.3) == pytest.approx((1, 1, 1, 1))


def test_no_textures() -> None:
    textures = pack([])
    assert textures.texels.dtype == np.uint8 and len(textures.offset) == 0
