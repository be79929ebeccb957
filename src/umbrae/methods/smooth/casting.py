"""One light's surface as a soup of triangles that count, each in its way."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.bvh import BoxTree, build
from umbrae.geometry.smooth_surface import SmoothSurface, bands, core
from umbrae.geometry.volume_faces import facing_of_all
from umbrae.light import Light
from umbrae.methods.smooth.silhouette import Silhouettes
from umbrae.scene import Scene


class Casting(NamedTuple):
    """All that a surface consists of, and what each triangle of it does.

    Attributes
    ----------
    surface
        What it was made of.
    soup
        The scene's triangles first, then pieces of those that were cut, then bands: `k` in all.
    weight
        `(k,) int32`: what a crossing counts.
    facing
        `(k,) int8`: the side that the light is on.
    source
        `(k,) int32`: the scene's triangle that each is a piece of, itself for bands.
    corners
        `(k, 3) int32`: the mesh's vertices around each.
    core
        `(t,) bool`: the scene's triangles that shade whatever crosses them.
    doubtful, boxes
        `(m,) int32`: the triangles that count, but not those of the core; boxes over them.
    own
        Chain, turned and values of the scene's triangles, as `silhouette.way_at` takes them.
    """

    surface: SmoothSurface
    soup: Scene
    weight: NDArray[np.int32]
    facing: NDArray[np.int8]
    source: NDArray[np.int32]
    corners: NDArray[np.int32]
    core: NDArray[np.bool_]
    doubtful: NDArray[np.int32]
    boxes: BoxTree
    own: tuple[NDArray[np.int32], NDArray[np.int8], NDArray[np.float64]]


def casting_of(silhouettes: Silhouettes, surface: SmoothSurface, light: Light) -> Casting:
    """Close a surface with its bands, and find what each triangle counts."""
    mesh, closing = silhouettes.mesh, bands(surface)
    count = len(mesh.triangles)
    soup = Scene(
        np.concatenate([surface.positions, closing.points]), np.concatenate([surface.triangles, closing.triangles])
    )
    added = facing_of_all(soup.positions, soup.triangles[count:], light.position)
    facing = np.concatenate([surface.faces.facing, added])
    weight = np.concatenate([surface.chain, surface.bounds.times[closing.part]]) * facing
    shades = core(mesh, surface)
    counts = weight != 0
    counts[:count] &= ~shades
    doubtful = np.flatnonzero(counts).astype(np.int32)
    return Casting(
        surface=surface,
        soup=soup,
        weight=weight,
        facing=facing,
        source=np.concatenate([surface.source, np.arange(len(surface.source), len(weight), dtype=np.int32)]),
        corners=np.concatenate([mesh.welded[mesh.triangles[surface.source]], surface.bounds.corners[closing.part]]),
        core=shades,
        doubtful=doubtful,
        boxes=build(soup.positions, soup.triangles[doubtful]),
        own=(surface.chain[:count], mesh.turned, surface.faces.values),
    )
