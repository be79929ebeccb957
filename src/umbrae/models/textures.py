"""Small pictures computed from noise, for the surfaces of generated scenes; `(n, n, 4) uint8`, repeating."""

import numpy as np
from numpy.typing import NDArray

Texture = NDArray[np.uint8]
Field = NDArray[np.float64]


def paving(size: int, tiles: int, light: str, dark: str, seed: int) -> Texture:
    """Square slabs in slightly different tones with darker joints."""
    rng = np.random.default_rng(seed)
    across = np.arange(size) * tiles / size
    tone = rng.random((tiles, tiles))[np.ix_(across.astype(int), across.astype(int))]
    tone = 0.75 * tone + 0.25 * _noise(size, 32, rng)
    gap = np.minimum(across % 1, 1 - across % 1) < 0.02
    joint = gap[:, None] | gap[None, :]
    return _blend(np.where(joint, 1.6, tone), light, dark)


def bands(size: int, light: str, dark: str, seed: int) -> Texture:
    """Horizontal layers, as in travertine or timber."""
    rng = np.random.default_rng(seed)
    layers = _noise(size, 24, rng)[:, :1] + 0.35 * (_noise(size, 8, rng) - 0.5)
    return _blend(layers, light, dark)


def marble(size: int, light: str, dark: str, seed: int) -> Texture:
    """Thin bright veins through a dark ground."""
    rng = np.random.default_rng(seed)
    field = _noise(size, 3, rng) + 0.4 * _noise(size, 9, rng) + 0.15 * _noise(size, 27, rng)
    veins = np.abs(np.sin(2.5 * np.pi * field)) ** 0.3
    return _blend(0.3 * veins + 0.7 * veins * _noise(size, 6, rng) ** 0.5, light, dark)


def mottled(size: int, light: str, dark: str, seed: int) -> Texture:
    """Soft blotches, as of a lawn seen from afar."""
    rng = np.random.default_rng(seed)
    return _blend(0.4 * _noise(size, 8, rng) + 0.6 * _noise(size, 64, rng), light, dark)


def sprig(size: int, light: str, dark: str, seed: int) -> Texture:
    """A twig with pointed leaves; everything around them is transparent."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:size, 0:size] / size
    tone, alpha = np.zeros((size, size)), np.zeros((size, size))
    stem = (np.abs(x - 0.5) < 0.012) & (y > 0.25)
    tone[stem], alpha[stem] = 1.0, 1.0
    for k in range(13):
        turn = np.pi / 2 + (k / 6 - 1) * 1.45
        foot = np.array([0.5, 0.62 + 0.05 * (k % 4)])
        along = (x - foot[0]) * np.cos(turn) - (y - foot[1]) * np.sin(turn)
        across = (x - foot[0]) * np.sin(turn) + (y - foot[1]) * np.cos(turn)
        t = along / (0.36 + 0.2 * np.sin(turn) ** 2)
        leaf = (t > 0) & (t < 1) & (np.abs(across) < 0.075 * np.sin(np.pi * np.clip(t, 0, 1)) ** 0.7)
        alpha[leaf] = 1.0
        tone[leaf] = (rng.random() * 0.6 + 0.4 * (np.abs(across) < 0.006))[leaf]
    texture = _blend(tone, light, dark)
    texture[..., 3] = np.round(255 * alpha)
    return texture


def _noise(size: int, cells: int, rng: np.random.Generator) -> Field:
    """Smoothly interpolated random values in [0, 1] that repeat at the borders."""
    values = rng.random((cells, cells))
    at = np.arange(size) * cells / size
    low, part = at.astype(int), at % 1
    part = part * part * (3 - 2 * part)
    high = (low + 1) % cells
    rows = values[low] * (1 - part)[:, None] + values[high] * part[:, None]
    field: Field = rows[:, low] * (1 - part) + rows[:, high] * part
    return field


def _blend(amount: Field, light: str, dark: str) -> Texture:
    """Opaque mixture of two colours given as `rrggbb`; 0 is light, 1 is dark, more is darker still."""
    first, second = (np.array(list(bytes.fromhex(color)), np.float64) for color in (light, dark))
    mixed = first + np.clip(amount, 0.0, 2.0)[..., None] * (second - first)
    opaque = np.full((*amount.shape, 1), 255.0)
    texture: Texture = np.round(np.clip(np.concatenate([mixed, opaque], axis=2), 0, 255)).astype(np.uint8)
    return texture
