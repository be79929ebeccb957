"""Stochastic transparency: each sample sees one surface, chosen by chance (Enderton et al. 2010).

A sample goes through its surfaces front to back. One that lets the shares f pass per colour channel is passed with
probability p = max f, and what is seen behind counts f / p; it is seen itself with probability 1 - p, and what it
sheds, of which layers put together count the opacity a, counts a / (1 - p). So the mean is that of all surfaces put
together, in each channel; and no sample outshines what it sees, since the share that is shed is at most a (1 - p).
Without transmission every sample counts 1, which is the paper's case.

Sintorn et al. (2011, section 3.2) propose it for transparent receivers of shadows. Deviations: colours, by the factors
above; surfaces are found by peeling instead of a depth test, since a factor is that of all surfaces passed. As in the
paper, the samples of a pixel are stratified, for each triangle on its own (see `geometry.chance`).
"""

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera
from umbrae.checks import is_whole, shown
from umbrae.clock import Clock
from umbrae.errors import OptionError
from umbrae.geometry.chance import VIEW, chance, key_of
from umbrae.geometry.glass import mirrored
from umbrae.geometry.normals import facet_normal, smooth_normal
from umbrae.geometry.vectors import row, subtract, unit
from umbrae.memory import require
from umbrae.parallel import kernel, run
from umbrae.samples import ViewSamples
from umbrae.sampling.bands import Geometry, Picture
from umbrae.sampling.cpu import Bands
from umbrae.sampling.drawing import Floor
from umbrae.sampling.layers import widen
from umbrae.sampling.seen import Seen, picture_of
from umbrae.scene import Scene
from umbrae.transmission import SOLID, Transmission, surface_at, transmission_of


def sample_stochastic(
    scene: Scene, camera: Camera, samples_per_pixel: int = 1, seed: int = 0, clock: Clock | None = None
) -> ViewSamples:
    """Find one point of the scene per sample, through transparent surfaces by chance.

    `ViewSamples.throughput` says what each sample counts. Exact on average is the light that samples shed, before tone
    mapping, and that of each colour channel; approximate is what `shade` averages over a pixel's footprint, the colours
    of textures.

    Parameters
    ----------
    samples_per_pixel, clock
        As for `sample`; the fewer, the noisier.
    seed
        Chooses the chances: the same one gives the same samples.

    Raises
    ------
    InputError
        When a texture decides how much light passes, and the scene has no texture coordinates.
    OptionError
        When `samples_per_pixel` is not a whole number from 1, or `seed` none from 0 that 63 bits hold.
    CapacityError
        When the result would not fit into memory.
    """
    check_seed(seed)
    picture = picture_of(scene, camera, samples_per_pixel)
    total = picture.width * picture.height * len(picture.x)
    require(total * 12, f"weights of a picture of {picture.width} x {picture.height} pixels")
    bands, table, key = Bands.of(scene, camera, picture), transmission_of(scene), key_of(seed, VIEW)
    normals = np.zeros((0, 3), np.float32) if scene.normals is None else scene.normals.view()
    normals.flags.writeable = False
    seen, throughput = Seen.of(picture), np.ones((total, 3), np.float32)

    def band(index: int) -> None:
        top, bottom = bands.rows(index)
        part = seen.rows(picture, top, bottom)
        nearest = bands.draw(index, Floor.before_all(picture), part)
        if table is None:
            return
        begin = top * picture.width * len(picture.x)
        weight = throughput[begin : begin + len(nearest)]
        floor = Floor.of(len(nearest))
        floor.depth[:] = 0.0
        shared = (bands.geometry, table, normals, camera.eye, key)
        while _pass(*shared, part, nearest, picture, top, floor, weight):
            behind = Seen.background(len(nearest))
            nearest = bands.draw(index, floor, behind)
            part.put(behind, floor.depth < np.inf)

    run(band, bands.tasks, clock)
    return seen.samples(scene, camera, throughput)


def check_seed(seed: int) -> None:
    """Refuse anything but a whole number from 0 that 63 bits hold."""
    if not is_whole(seed) or not 0 <= seed < 1 << 63:
        raise OptionError(f"seed: wanted a whole number from 0 to 2**63 - 1, got {shown(seed)}")


@kernel
def _pass(
    geometry: Geometry,
    table: Transmission,
    normals: NDArray[np.float32],
    eye: NDArray[np.float64],
    key: np.uint64,
    part: Seen,
    nearest: NDArray[np.float64],
    picture: Picture,
    top: int,
    floor: Floor,
    weight: NDArray[np.float32],
) -> bool:
    """Draw chances for what samples of a band have come to, where they still go on; returns whether any passes.

    Samples that go no farther have an infinite depth in `floor`.
    """
    kind, material_id, _, _, base, transmitted, cutoff, mode, uv, colors, texels, offset, size = table
    positions, triangles = geometry.positions, geometry.triangles
    triangle, barycentric, position = part.triangle, part.barycentric, part.position
    depth, before, box = floor
    width, per_pixel = picture.width, len(picture.x)
    from_eye = (eye[0], eye[1], eye[2])
    box[0], box[1], box[2], box[3] = picture.height, -1, width, -1
    for at in range(len(triangle)):
        if depth[at] == np.inf:
            continue
        depth[at] = np.inf
        t = triangle[at]
        if t < 0 or kind[t] == SOLID:
            continue
        u, v = np.float64(barycentric[at, 0]), np.float64(barycentric[at, 1])
        red, green, blue, alpha = surface_at(
            triangles, material_id, base, cutoff, mode, uv, colors, texels, offset, size, t, 1.0 - u - v, u, v
        )
        glass = transmitted[material_id[t]]
        if glass > 0.0:
            a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            normal = facet_normal(positions, a, b, c)
            if normals.shape[0] > 0:
                smooth, agreement = smooth_normal(normals, a, b, c, u, v, normal)
                if agreement != 0.0:
                    normal = smooth
            glass *= 1.0 - mirrored(normal, unit(subtract(from_eye, row(position, at))))
        most = max(red, green, blue)
        passing = (1.0 - alpha) + alpha * glass * most
        if chance(key, np.int64(t), np.int64(top * width * per_pixel + at), np.int64(per_pixel)) >= passing:
            if glass > 0.0:
                # a / (1 - p); the opacity cancels.
                share = 1.0 / (1.0 - glass * most)
                weight[at, 0] *= share
                weight[at, 1] *= share
                weight[at, 2] *= share
            continue
        if glass > 0.0:
            weight[at, 0] *= ((1.0 - alpha) + alpha * glass * red) / passing
            weight[at, 1] *= ((1.0 - alpha) + alpha * glass * green) / passing
            weight[at, 2] *= ((1.0 - alpha) + alpha * glass * blue) / passing
        depth[at], before[at] = nearest[at], t
        widen(box, top, at, width, per_pixel)
    return bool(box[0] <= box[1])
