"""Per-triangle shadow frusta, rasterized hierarchically over the view samples in compute shaders."""

from dataclasses import dataclass
from typing import ClassVar

from umbrae.clock import Clock
from umbrae.mask import Guarantee
from umbrae.methods.frustum_gl.caster import FrustumGlCaster
from umbrae.methods.method import Method, check_transparency
from umbrae.scene import Scene


@dataclass(frozen=True)
class FrustumGl(Method):
    """Exact shadows of any triangle soup after Sintorn, Olsson and Assarsson 2011, on OpenGL 4.5.

    Casters may let light through.

    The samples of a picture are the leaves of a tree of tiles with 32 children each, 8 x 4 and 4 x 8 in turns, and
    with their bounds in the camera's normalized device coordinates. A list, which no camera sees, is sorted along a
    curve in space and cut into tiles of 32 that follow each other, as seen from an eye beside all of it. Each
    triangle's shadow frustum goes down that tree: a node is rejected, accepted (one bit then darkens all below), or
    refined. A work group of 32 lanes serves a frustum; they exchange what they found through shared memory.

    Planes are tested in float32 with derived bounds (`setup.glsl`). The pairs of a sample and a triangle that this
    leaves open are decided in float64 with the bounds of `geometry.predicates`, and what that leaves open, exactly on
    the CPU: rasterizers propose, one predicate decides.

    Casters that let light through go down after the solid ones, past what those left lit (section 3.2). Where a
    triangle lets the same share through everywhere, each node that is accepted adds -log of it to a sum for each colour
    channel, and sums of nodes come down to the samples in the end; where textures or vertex colours decide, they are
    looked up in float64 for each sample, at barycentrics that are its distances from the side planes. So does every
    such triangle where chance decides, for one bit per sample and channel.

    Deviations from the paper: nodes have bounds in x and y too, those of the samples they hold, since a sample is a
    point of its triangle that need not lie at a pixel's centre; the silhouette of a frustum seen from the eye is
    bounded by up to four planes instead of two; there is no bias, as a sample knows its own triangle; in large pictures
    each node of 32768 samples that a frustum meets is a task for a group of its own; a node that is full tells its
    parent; sums are whole numbers that saturate, so that masks do not depend on the order of the work.

    Options
    -------
    silhouette_planes
        Test the planes through the eye and the silhouette of the frustum as well (section 3.5).
    skip_full
        Leave out nodes that are in shadow already (section 3.5).
    culling
        Leave out groups of triangles whose box, extruded away from the light, surely meets no sample that is not dark,
        before anything is computed about their triangles. It never changes a mask.
    front_face_culling
        Leave out the triangles of solids that face away from the light, as the option of `frustum` does.
    transparency, seed
        Those of `frustum`: the same chances, so the same mask where no rounding of opacities comes between.
    """

    silhouette_planes: bool = True
    skip_full: bool = True
    culling: bool = True
    front_face_culling: bool = False
    transparency: str = "exact"
    seed: int = 0

    name: ClassVar[str] = "frustum-gl"
    paper: ClassVar[str] = "Sintorn, Olsson, Assarsson 2011"
    guarantee: ClassVar[Guarantee] = Guarantee.EXACT
    engine: ClassVar[str] = "OpenGL"
    accepts: ClassVar[tuple[str, ...]] = ("pictures", "points", "transparency")

    def __post_init__(self) -> None:
        check_transparency(self.name, self.transparency, self.seed)

    def prepare(self, scene: Scene, clock: Clock | None = None) -> FrustumGlCaster:
        seed = self.seed if self.transparency == "stochastic" else None
        options = self.silhouette_planes, self.skip_full, self.culling, self.front_face_culling
        return FrustumGlCaster(scene, *options, seed, clock)
