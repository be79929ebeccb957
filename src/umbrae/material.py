"""What a surface looks like and how much light it lets through."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from umbrae.checks import array, number, shown
from umbrae.errors import InputError

AlphaMode = Literal["OPAQUE", "MASK", "BLEND"]


@dataclass(frozen=True, eq=False)
class Material:
    """Surface description after glTF 2.0.

    Parameters
    ----------
    base_color
        Linear RGB and opacity, four numbers in [0, 1].
    alpha_mode
        "OPAQUE" ignores opacity, "MASK" cuts it at `alpha_cutoff`, "BLEND" keeps it.
    transmission
        Share of light that passes through instead of being reflected diffusely, in [0, 1]
        (KHR_materials_transmission).
    texture
        `(h, w, 4) uint8`, sRGB colour with linear alpha, row 0 at the top (uv = (0, 0) is the top left corner, as
        in glTF), repeated outside [0, 1]; or anything `numpy.asarray` makes into `(h, w)`, `(h, w, 3)` or
        `(h, w, 4) uint8`; or a Pillow image. Multiplied with `base_color`.

    Raises
    ------
    InputError
        For numbers outside [0, 1], an unknown alpha mode, or a texture of another shape or dtype.
    """

    base_color: tuple[float, float, float, float] = (0.8, 0.8, 0.8, 1.0)
    alpha_mode: AlphaMode = "OPAQUE"
    alpha_cutoff: float = 0.5
    transmission: float = 0.0
    texture: NDArray[np.uint8] | None = None
    double_sided: bool = True
    name: str = ""

    def __post_init__(self) -> None:
        color = array(self.base_color, "Material.base_color")
        in_range = color.dtype.kind in "iuf" and bool(((color >= 0) & (color <= 1)).all())
        if color.shape not in ((3,), (4,)) or not in_range:
            raise InputError(f"Material.base_color: wanted 4 numbers in [0, 1], got {shown(self.base_color)}")
        opaque = [1.0] if len(color) == 3 else []
        object.__setattr__(self, "base_color", tuple(color.astype(float).tolist() + opaque))
        if self.alpha_mode not in ("OPAQUE", "MASK", "BLEND"):
            raise InputError(f"Material.alpha_mode: wanted OPAQUE, MASK or BLEND, got {self.alpha_mode!r}")
        if not 0.0 <= number(self.transmission, "Material.transmission") <= 1.0:
            raise InputError(f"Material.transmission: wanted a number in [0, 1], got {self.transmission}")
        if not number(self.alpha_cutoff, "Material.alpha_cutoff") >= 0.0:
            raise InputError(f"Material.alpha_cutoff: wanted a number >= 0, got {self.alpha_cutoff}")
        if self.texture is not None:
            object.__setattr__(self, "texture", _rgba(self.texture))

    @property
    def casts_solid(self) -> bool:
        """Whether nothing of this surface lets light through."""
        return self.alpha_mode == "OPAQUE" and self.transmission == 0.0


def texels(picture: Any, name: str) -> NDArray[np.uint8]:
    """A Pillow image as `(h, w, 4) uint8`; 16 bits of grey are scaled. Messages call it by its name.

    Raises
    ------
    InputError
        For other kinds of numbers, which Pillow would clip: no one knows which of them is white.
    """
    if picture.mode.startswith("I;16"):
        grey = ((np.asarray(picture).astype(np.uint32) * 255 + 32767) // 65535).astype(np.uint8)
        return np.dstack([grey, grey, grey, np.full_like(grey, 255)])
    if picture.mode in ("I", "F"):
        kind = {"I": "32-bit integers", "F": "floating-point numbers"}[picture.mode]
        raise InputError(f"{name}: wanted a picture of 8 or 16 bits per channel, got {kind}")
    return np.asarray(picture.convert("RGBA"))


def _rgba(texture: Any) -> NDArray[np.uint8]:
    """Any 8-bit image, or a Pillow image, as `(h, w, 4)`."""
    if hasattr(texture, "convert"):
        texture = texels(texture, "Material.texture")
    pixels = array(texture, "Material.texture")
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[:, :, None], 3, axis=2)
    if pixels.ndim != 3 or pixels.shape[2] not in (3, 4) or pixels.dtype != np.uint8 or 0 in pixels.shape:
        raise InputError(
            f"Material.texture: wanted (h, w), (h, w, 3) or (h, w, 4) uint8, got {pixels.shape} {pixels.dtype}"
        )
    if pixels.shape[2] == 3:
        pixels = np.concatenate([pixels, np.full((*pixels.shape[:2], 1), 255, np.uint8)], axis=2)
    return np.ascontiguousarray(pixels)
