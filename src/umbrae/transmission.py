"""What a caster lets through: per colour channel, `(1 - a) + a t c`.

`a` is the opacity: alpha of the base colour, times that of texture and vertex colours, cut to 0 or 1 by alpha mode MASK
and taken as 1 by OPAQUE; `t` the share of light that is transmitted (KHR_materials_transmission), `c` the base colour
times texture and vertex colours. All is linear. What a thick body absorbs is not modelled.
"""

from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from umbrae.errors import InputError
from umbrae.geometry.texture import SRGB_TO_LINEAR, fetch, pack
from umbrae.material import Material
from umbrae.parallel import expand
from umbrae.scene import Family, Scene

SOLID, CLEAR, EVEN, VARYING = range(4)
"""Kinds of triangles: nothing passes anywhere, everything does, the same everywhere, or it depends on the place."""

OPAQUE, MASK, BLEND = range(3)
"""Alpha modes as numbers."""

ROUNDING = 2.0**-48
"""What an opacity may be off by: 7 roundings of 2**-53 in the look-up, 1 for the base colour's, 5 for vertex colours.

Without it, a fifth of the places where all texels around are opaque would come out a little less than that, and so
would those exactly at the cutoff.
"""


class Transmission(NamedTuple):
    """What each triangle of a scene lets through, as kernels take it.

    Attributes
    ----------
    kind
        `(t,) uint8`: `SOLID`, `CLEAR`, `EVEN` or `VARYING`.
    material_id
        `(t,) int32`.
    closed
        `(m,) bool`: the material is opaque wherever it is there at all, so that its triangles shadow what lies on
        their side planes, like solid ones. All others give a shared edge to one of its two triangles.
    even
        `(m, 3) float64`: the share that passes, for triangles of kind `EVEN`.
    base
        `(m, 4) float64` base colour and alpha, in a scene without `uv` times that of the texture; `transmitted (m,)`,
        `cutoff (m,)`, `mode (m,)` as above.
    uv, colors
        `(v, 2)` and `(v, 4) float32`, no rows where the scene has none.
    texels, offset, size
        `geometry.texture.Textures` of the materials; none where a texture does not matter.
    """

    kind: NDArray[np.uint8]
    material_id: NDArray[np.int32]
    closed: NDArray[np.bool_]
    even: NDArray[np.float64]
    base: NDArray[np.float64]
    transmitted: NDArray[np.float64]
    cutoff: NDArray[np.float64]
    mode: NDArray[np.int8]
    uv: NDArray[np.float32]
    colors: NDArray[np.float32]
    texels: NDArray[np.uint8]
    offset: NDArray[np.int64]
    size: NDArray[np.int64]


# Textures are looked through once per scene: sampling, shadows and shading all ask. Moving it changes nothing.
_TABLES: WeakKeyDictionary[Family, Transmission | None] = WeakKeyDictionary()


def transmission_of(scene: Scene) -> Transmission | None:
    """What the triangles of a scene let through; None when all are solid.

    Raises
    ------
    InputError
        When it depends on the place in a texture, and the scene has no texture coordinates.
    """
    if scene.family not in _TABLES:
        _TABLES[scene.family] = _table(scene)
    return _TABLES[scene.family]


def _table(scene: Scene) -> Transmission | None:
    materials = scene.materials
    if all(material.casts_solid for material in materials):
        return None
    kind_of, even = np.empty(len(materials), np.uint8), np.zeros((len(materials), 3))
    ranges = np.array([_range(material) for material in materials])
    for index, material in enumerate(materials):
        kind_of[index], even[index] = _alone(material, *ranges[index])
    kind = kind_of[scene.material_id]
    if scene.colors is not None and any(not material.casts_solid for material in materials):
        # Vertex colours can only lower: alpha where it counts and something is there, colour where some of it passes.
        corners = scene.colors[scene.triangles]
        blends = np.array([material.alpha_mode != "OPAQUE" for material in materials])[scene.material_id]
        tints = np.array([material.transmission > 0.0 for material in materials])[scene.material_id]
        fades = blends & (kind != CLEAR) & (corners[..., 3] != 1).any(axis=1)
        kind[fades | (tints & (kind != SOLID) & (corners[..., :3] != 1).any(axis=(1, 2)))] = VARYING
    if (kind == SOLID).all():
        return None
    base = np.array([m.base_color for m in materials], np.float64)
    if scene.uv is None:
        # Textures that are the same everywhere, but for what does not matter, need no coordinates.
        matters = np.array([[m.transmission > 0.0] * 3 + [m.alpha_mode != "OPAQUE"] for m in materials])
        place = (matters & (ranges[:, 0] != ranges[:, 1])).any(axis=1)
        base = np.ascontiguousarray(ranges[:, 0])
        for index in np.unique(scene.material_id[place[scene.material_id] & (kind == VARYING)]):
            raise InputError(
                f"material {index} ({materials[index].name!r}): its texture decides how much light passes, but the "
                "scene has no texture coordinates (Scene.uv)"
            )
    textures = pack([None if scene.uv is None or m.casts_solid else m.texture for m in materials])
    return Transmission(
        kind,
        scene.material_id,
        np.array([m.alpha_mode == "MASK" and m.transmission == 0.0 for m in materials]),
        even,
        base,
        np.array([m.transmission for m in materials], np.float64),
        np.array([m.alpha_cutoff for m in materials], np.float64),
        np.array([("OPAQUE", "MASK", "BLEND").index(m.alpha_mode) for m in materials], np.int8),
        _rows(scene.uv, 2),
        _rows(scene.colors, 4),
        *textures,
    )


def _range(material: Material) -> NDArray[np.float64]:
    """`(2, 4)`: the least and the most of colour and alpha, vertex colours aside, where they may matter."""
    color = np.array(material.base_color, np.float64)
    if material.texture is None or material.casts_solid:
        return np.stack([color, color])
    pixels = material.texture.reshape(-1, 4)
    ends = np.stack([pixels.min(axis=0), pixels.max(axis=0)])
    found: NDArray[np.float64] = color * np.column_stack([SRGB_TO_LINEAR[ends[:, :3]], ends[:, 3] / 255.0])
    return found


def _alone(material: Material, low: NDArray[np.float64], high: NDArray[np.float64]) -> tuple[int, NDArray[np.float64]]:
    """The kind of a material's triangles, vertex colours aside, and what passes if that is the same everywhere."""
    nothing = np.zeros(3)
    if material.casts_solid:
        return SOLID, nothing
    a_low, a_high = {
        "OPAQUE": (1.0, 1.0),
        "MASK": (float(low[3] >= material.alpha_cutoff), float(high[3] >= material.alpha_cutoff)),
        "BLEND": (float(low[3]), float(high[3])),
    }[material.alpha_mode]
    if a_high == 0.0:
        return CLEAR, np.ones(3)
    if a_low != a_high or (material.transmission > 0.0 and (low[:3] != high[:3]).any()):
        return VARYING, nothing
    passes = (1.0 - a_low) + a_low * material.transmission * low[:3]
    if (passes == 0.0).all():
        return SOLID, nothing
    if (passes == 1.0).all():
        return CLEAR, passes
    return EVEN, passes


def _rows(values: NDArray[np.float32] | None, width: int) -> NDArray[np.float32]:
    if values is not None:
        return values
    none = np.zeros((0, width), np.float32)
    none.flags.writeable = False  # as the scene's own arrays: to Numba it is part of the type
    return none


@expand
def surface_at(triangles, material_id, base, cutoff, mode, uv, colors, texels, offset, size, t, wa, wb, wc):  # type: ignore[no-untyped-def]
    """Colour c and opacity a, four numbers, of triangle t, which is not solid, at a place with these barycentrics.

    Takes the arrays of a `Transmission` one by one: kernels unpack them once, since every access to a member of a tuple
    counts references.
    """
    m = material_id[t]
    a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    red, green, blue, alpha = base[m, 0], base[m, 1], base[m, 2], base[m, 3]
    if offset[m] >= 0:
        u = wa * uv[a, 0] + wb * uv[b, 0] + wc * uv[c, 0]
        v = wa * uv[a, 1] + wb * uv[b, 1] + wc * uv[c, 1]
        r, g, bl, al = fetch(texels, offset, size, m, u, v)
        red, green, blue, alpha = red * r, green * g, blue * bl, alpha * al
    if len(colors) > 0:
        red *= wa * colors[a, 0] + wb * colors[b, 0] + wc * colors[c, 0]
        green *= wa * colors[a, 1] + wb * colors[b, 1] + wc * colors[c, 1]
        blue *= wa * colors[a, 2] + wb * colors[b, 2] + wc * colors[c, 2]
        alpha *= wa * colors[a, 3] + wb * colors[b, 3] + wc * colors[c, 3]
    if mode[m] == OPAQUE or alpha > 1.0 - ROUNDING:
        alpha = 1.0
    if mode[m] == MASK:
        alpha = 1.0 if alpha >= cutoff[m] - ROUNDING else 0.0
    return red, green, blue, alpha


@expand
def passing(
    triangles: NDArray[np.int32], table: Transmission, t: int, wa: float, wb: float, wc: float
) -> tuple[float, float, float]:
    """What triangle t, of kind `VARYING`, lets through at a place with these barycentrics."""
    material_id, _, _, base, _, cutoff, mode, uv, colors, texels, offset, size = table[1:]
    red, green, blue, alpha = surface_at(
        triangles, material_id, base, cutoff, mode, uv, colors, texels, offset, size, t, wa, wb, wc
    )
    share = alpha * table.transmitted[table.material_id[t]]
    clear = 1.0 - alpha
    return clear + share * red, clear + share * green, clear + share * blue
