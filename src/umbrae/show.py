"""Figures of shadow volumes: the counter in false colour, the volumes as translucent layers. Arrays in, an image out.

All arrays have the size of a finer picture, `fine` times as wide and as high, which is averaged in the end.
"""

import numpy as np
from numpy.typing import NDArray
from PIL import Image as PillowImage
from PIL import ImageDraw, ImageFilter, ImageFont

from umbrae.image import Image

PALETTE = np.array(
    [
        (68, 119, 170), (102, 204, 238), (34, 136, 51), (204, 187, 68),
        (238, 119, 51), (204, 51, 80), (146, 64, 156), (66, 36, 96),
    ],
    np.float32,
)  # fmt: skip
"""After Tol's bright scheme: neighbours differ for everyone, and in grey."""
FIRST_OF_CLASS = (1, 2, 3, 4, 5, 8, 16, 32)
"""The lowest count of each colour, where counts above eight occur; otherwise each count has its own."""
BELOW_ZERO = np.zeros(3, np.float32)
_ZERO = np.full(3, 205, np.float32)
LAYER, EDGE, SILHOUETTE = (np.array(rgb, np.float32) for rgb in ((255, 174, 40), (122, 60, 8), (176, 16, 48)))
_PAPER, _INK, _FAINT = (246, 245, 242), (38, 40, 46), (98, 101, 110)
_LUMINANCE = np.array((0.2126, 0.7152, 0.0722), np.float32)


def legend_height(width: int) -> int:
    """Pixels that the legend of `count` takes below the picture."""
    return max(18, round(width * 0.034))


def count(picture: NDArray[np.uint8], counts: NDArray[np.int32], covered: NDArray[np.bool_], fine: int = 1) -> Image:
    """How many volumes hold each sample: one colour for each count over a grey picture, and a legend below.

    Parameters
    ----------
    picture
        `(h, w, 3)` the scene without shadows; its brightness stays visible.
    counts, covered
        `(h, w)`; background keeps its grey whatever its count.
    """
    grey = picture.astype(np.float32) @ _LUMINANCE
    shown = np.repeat((255 - (255 - grey) * 0.75)[..., None], 3, axis=2)
    classes = _classes(int(counts[covered].max(initial=0)))
    inside = covered & (counts > 0)
    form = 0.5 + 0.5 / 255 * grey[inside][:, None]
    color = np.searchsorted([low for low, _ in classes], counts[inside], side="right") - 1
    shown[inside] = (PALETTE[color] * 0.92 + 20) * form
    below = covered & (counts < 0)
    shown[below] = BELOW_ZERO
    pixels = _average(shown, fine)
    return Image(np.concatenate([pixels, _legend(pixels.shape[1], classes, bool(below.any()))]))


def volumes(
    picture: NDArray[np.uint8],
    faces: NDArray[np.int32],
    edges: NDArray[np.int32],
    silhouettes: NDArray[np.bool_],
    covered: NDArray[np.bool_],
    fine: int = 1,
) -> Image:
    """Side faces of volumes as translucent layers over a picture, their edges as thin lines, silhouettes as thick ones.

    Parameters
    ----------
    picture
        `(h, w, 3)` the scene with its shadows.
    faces, edges
        `(h, w)` how many of them lie in front of each sample.
    silhouettes
        `(h, w)` what `silhouette_lines` has drawn.
    covered
        `(h, w)`; before the background, where volumes go on for ever, layers are fainter.
    """
    color = picture.astype(np.float32)
    shown = 255 - (255 - (0.55 * color + 0.45 * (color @ _LUMINANCE)[..., None])) * 0.8
    faint = np.where(covered, np.float32(1), np.float32(0.45))
    layers, lines = faces.astype(np.float32), edges.astype(np.float32)
    # Each layer lets most of the light pass; no number of them hides what lies behind.
    _lay_over(shown, LAYER, 0.7 * (1 - np.exp(-0.17 * layers)) * faint)
    # Where hundreds lie, lines would be all there is; silhouettes fade where they crowd, such as on leaves.
    _lay_over(shown, EDGE, 0.5 * (1 - np.exp(-0.5 * lines)) * faint / (1 + 0.03 * layers))
    blurred = PillowImage.fromarray(silhouettes.astype(np.uint8) * 255).filter(ImageFilter.BoxBlur(12 * fine))
    density = np.asarray(blurred).astype(np.float32) / 255
    _lay_over(shown, SILHOUETTE, silhouettes * 0.85 / (1 + (4 * density) ** 2))
    return Image(_average(shown, fine))


def silhouette_lines(
    edges: NDArray[np.floating],
    world_to_clip: NDArray[np.float64],
    near: float,
    depth: NDArray[np.float32],
    thickness: int = 1,
) -> NDArray[np.bool_]:
    """`(h, w)` where `edges (e, 2, 3)` are seen, as lines of `thickness` samples; `depth (h, w)` hides them.

    `world_to_clip (3, 4)` is the camera's; `near` the least distance along its view direction.
    """
    height, width = depth.shape
    ends = edges.astype(np.float64) @ world_to_clip[:, :3].T + world_to_clip[:, 3]
    start, end = _clip(ends[:, 0], ends[:, 1], near)
    scale = np.array([width / 2, -height / 2])
    first, last = (point[:, :2] / point[:, 2:] * scale + (width / 2, height / 2) for point in (start, end))
    steps = np.ceil(np.abs(last - first).max(axis=1, initial=0)).astype(np.int64) + 1
    which = np.repeat(np.arange(len(steps)), steps)
    # What is linear across the picture is the inverse of the distance.
    share = ((np.arange(len(which)) - np.repeat(np.cumsum(steps) - steps, steps)) + 0.5) / steps[which]
    x, y = ((1 - share) * first[which].T + share * last[which].T).astype(np.int64)
    inverse = (1 - share) / start[which, 2] + share / end[which, 2]
    x, y = np.clip(x, 0, width - 1), np.clip(y, 0, height - 1)
    # A sample further: an edge lies on the border of what it belongs to.
    seen = 1 / inverse <= _largest_around(depth)[y, x] * (1 + 1e-3)
    drawn = np.zeros(depth.shape, bool)
    drawn[y[seen], x[seen]] = True
    thick = drawn.copy()
    for down in range(thickness):
        for right in range(thickness):
            thick[down:, right:] |= drawn[: height - down, : width - right]
    return thick


def _clip(
    start: NDArray[np.float64], end: NDArray[np.float64], near: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The parts of segments `(e, 3)` in clip coordinates that are inside the picture and beyond the near plane."""
    low, high = np.zeros(len(start)), np.ones(len(start))
    for plane, offset in (((0, 0, 1), -near), ((1, 0, 1), 0), ((-1, 0, 1), 0), ((0, 1, 1), 0), ((0, -1, 1), 0)):
        at_start, at_end = start @ plane + offset, end @ plane + offset
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = at_start / (at_start - at_end)
        low = np.where(at_start < 0, np.where(at_end < 0, 2.0, np.maximum(low, crossing)), low)
        high = np.where((at_end < 0) & (at_start >= 0), np.minimum(high, crossing), high)
    inside = np.flatnonzero(low < high)
    way = (end - start)[inside]
    return start[inside] + low[inside, None] * way, start[inside] + high[inside, None] * way


def _largest_around(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """The largest of each 3 x 3."""
    padded = np.pad(values, 1, mode="edge")
    rows = np.maximum(np.maximum(padded[:-2], padded[1:-1]), padded[2:])
    largest: NDArray[np.float32] = np.maximum(np.maximum(rows[:, :-2], rows[:, 1:-1]), rows[:, 2:])
    return largest


def _lay_over(shown: NDArray[np.floating], color: NDArray[np.float32], opacity: NDArray[np.floating]) -> None:
    shown += (color - shown) * opacity[..., None]


def _average(shown: NDArray[np.floating], fine: int) -> NDArray[np.uint8]:
    """Averaged as shown: in linear light thin lines would fade."""
    height, width = shown.shape[0] // fine, shown.shape[1] // fine
    mean = shown.reshape(height, fine, width, fine, 3).mean(axis=(1, 3))
    pixels: NDArray[np.uint8] = np.round(np.clip(mean, 0, 255)).astype(np.uint8)
    return pixels


def _classes(most: int) -> list[tuple[int, int]]:
    """The lowest and the highest count of each colour, as far as counts go."""
    first = FIRST_OF_CLASS if most > len(PALETTE) else tuple(range(1, len(PALETTE) + 1))
    needed = [low for low in first if low <= most]
    return list(zip(needed, [*(low - 1 for low in needed[1:]), most], strict=True)) if needed else []


def _legend(width: int, classes: list[tuple[int, int]], below_zero: bool) -> NDArray[np.uint8]:
    """`(legend_height(width), width, 3)`: a swatch and the counts it stands for, from the left."""
    height = legend_height(width)
    strip = PillowImage.new("RGB", (width, height), _PAPER)
    draw = ImageDraw.Draw(strip)
    entries = [(BELOW_ZERO, "below 0")] if below_zero else []
    entries += [(_ZERO, "0")]
    entries += [
        (color, f"{low}" if low == high else f"{low}-{high}")
        for color, (low, high) in zip(PALETTE, classes, strict=False)
    ]
    title = "volumes around each sample"
    size, swatch, gap = height * 0.42, height * 0.42, height * 0.25
    font = ImageFont.load_default(size)
    wanted = sum(font.getlength(text) for text in (title, *(text for _, text in entries)))
    wanted += 5 * gap + len(entries) * (swatch + 4 * gap)
    if wanted > width:
        size, swatch, gap = (length * width / wanted for length in (size, swatch, gap))
        font = ImageFont.load_default(max(1.0, size))
    x, middle = 2 * gap, height / 2
    draw.text((x, middle), title, _FAINT, font, anchor="lm")
    x += font.getlength(title) + 3 * gap
    for color, text in entries:
        box = (x, middle - swatch / 2, x + swatch, middle + swatch / 2)
        draw.rectangle(box, tuple(int(part) for part in color))
        draw.text((x + swatch + gap, middle), text, _INK, font, anchor="lm")
        x += swatch + 4 * gap + font.getlength(text)
    return np.asarray(strip)
