"""Silhouettes drawn object by object, each by a call of its own, as Milet et al. do in their Tables 5 and 9."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.methods.volumes.engine import CountingEngine
from umbrae.methods.volumes.silhouette_gs import SilhouetteGs, SilhouetteGsCaster
from umbrae.methods.volumes.silhouette_ts import SilhouetteTs, SilhouetteTsCaster
from umbrae.scene import Scene


class ByObject(CountingEngine):
    """Sorts the primitives of each index buffer by object when it is first drawn; light caps stay one call."""

    def choose(self, kept: NDArray[np.bool_] | None) -> None:
        super().choose(kept)
        # Buffers of the last choice may be gone, and their names given to others.
        self._calls: dict[int, list[tuple[int, int]]] = {}

    def issue(self, array: Any, index: Any, mode: int) -> None:
        if index.glo not in self._calls:
            each = self.session.moderngl.patch_vertices if mode == self.session.moderngl.PATCHES else 4
            self._calls[index.glo] = self._sort(index, each)
        for first, count in self._calls[index.glo]:
            array.render(mode, vertices=count, first=first)

    def _sort(self, index: Any, each: int) -> list[tuple[int, int]]:
        """Bring primitives of `each` vertices into the order of their objects: first vertex and number of each call."""
        rows = np.frombuffer(index.read(), np.int32).reshape(-1, each)
        object_of = np.zeros(len(self.mesh.positions), np.int32)
        object_of[self.mesh.triangles] = self.scene.object_id[self.mesh.source, None]
        owner = object_of[rows[:, 0]]
        order = np.argsort(owner, kind="stable")
        index.write(rows[order].tobytes())
        _, first, count = np.unique(owner[order], return_index=True, return_counts=True)
        return [(each * int(at), each * int(many)) for at, many in zip(first, count, strict=True)]


@dataclass(frozen=True)
class TsByObject(SilhouetteTs):
    """`silhouette-ts`, drawn object by object."""

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "TsByObjectCaster":
        return TsByObjectCaster(scene, self, clock)


class TsByObjectCaster(ByObject, SilhouetteTsCaster):
    """Patches of an object in one call."""


@dataclass(frozen=True)
class GsByObject(SilhouetteGs):
    """`silhouette-gs`, drawn object by object."""

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "GsByObjectCaster":
        return GsByObjectCaster(scene, self, clock)


class GsByObjectCaster(ByObject, SilhouetteGsCaster):
    """Lines of an object in one call."""
