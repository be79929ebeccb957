"""Bytes of each buffer: section 4 of Sintorn, Olsson and Assarsson 2011."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from umbrae import models
from umbrae.bench.sweep import Cell, PaperRow, Quantity, Sweep, SweepRecord
from umbrae.camera import Camera
from umbrae.clock import Clock
from umbrae.errors import UmbraeError
from umbrae.light import Light
from umbrae.methods import Method, make_method
from umbrae.samples import ViewSamples
from umbrae.sampling import sample
from umbrae.scene import Scene

SIZES = (1024, 4096)
LIGHT = Light.point((4.0, 14.0, 6.0))
"""Over the pavilion; parallel light would need no cube."""
MEMORY = Quantity("memory", "MiB", 2**20, ("bytes",), comparable=True)
PER_SAMPLE = Quantity("memory a sample", "bits a sample", 1e6, ("bits_of_a_million_samples",), comparable=True)
_PAPER_SIZE = 4096
_ONE_BAND = 1 << 22
"""Pictures of so many pixels are one band in all methods."""

NOTE = (
    "The scene is the pavilion. Large pictures go in bands, one after the other in the same memory, and what is told "
    "is that of a band: up to 8.4 million samples, 4.2 million in the lists. Bits a sample are told of pictures that "
    "are one band. The paper has its picture in one piece, and counts what comes on top of its depths; here 'samples' "
    "stand in for these. Shadow maps have as many texels a side as the picture; the faces of a cube are drawn one "
    "after the other into the same texels, the paper keeps six. For its lists the paper adds a map of 1024 x 1024 "
    "texels of 512 bits, which it gives as 16 MB (64, multiplied out); here lists hold their verdicts themselves."
)


@dataclass(frozen=True)
class Buffer:
    """A row: whose buffer it is, in which scene, what counter tells its bytes, and the paper's megabytes."""

    row: str
    method: str
    counter: str
    translucent: bool = False
    megabytes: float | None = None


BUFFERS = (
    Buffer("frustum-gl, samples", "frustum-gl", "samples_bytes"),
    Buffer("frustum-gl, depth hierarchy", "frustum-gl", "hierarchy_bytes", megabytes=2.1),
    Buffer("frustum-gl, shadow buffer", "frustum-gl", "shadow_buffer_bytes", megabytes=2.1),
    Buffer("frustum-gl, real values", "frustum-gl", "shadow_buffer_bytes", True, 64.0),
    Buffer("frustum-gl, by chance", "frustum-gl by chance", "shadow_buffer_bytes", True, 2.0),
    Buffer("frustum, samples and hierarchy", "frustum", "hierarchy_bytes"),
    Buffer("frustum, shadow buffer", "frustum", "shadow_buffer_bytes", megabytes=2.1),
    Buffer("frustum, real values", "frustum", "shadow_buffer_bytes", True, 64.0),
    Buffer("frustum, by chance", "frustum by chance", "shadow_buffer_bytes", True, 2.0),
    Buffer("shadow volumes, stencil", "stencil", "counter_bytes", megabytes=16.0),
    Buffer("shadow volumes, float counter", "float", "counter_bytes"),
    Buffer("alias-free map, lists", "alias-free-map", "lists_bytes", megabytes=200.0),
    Buffer("shadow map, cube", "shadow-map", "map_bytes", megabytes=384.0),
)


def methods_of(size: int) -> dict[str, Method]:
    """The methods that `BUFFERS` name, for a picture with so many pixels a side."""
    return {
        "frustum": make_method("frustum"),
        "frustum by chance": make_method("frustum", transparency="stochastic"),
        "frustum-gl": make_method("frustum-gl"),
        "frustum-gl by chance": make_method("frustum-gl", transparency="stochastic"),
        "stencil": make_method("silhouette-gs", counter="stencil"),
        "float": make_method("silhouette-gs", counter="float"),
        "alias-free-map": make_method("alias-free-map"),
        "shadow-map": make_method("shadow-map", projection="cube", size=2 * size),
    }


def run_memory(sizes: Sequence[int], clock: Clock) -> SweepRecord:
    """Cast one shadow at each size for each method that has a buffer in the table."""
    columns = tuple(f"{size}x{size}" for size in sizes)
    cells: list[Cell] = []
    for size, column in zip(sizes, columns, strict=True):
        with clock.span(column):
            cells += _measure(models.pavilion(), size, column, clock)
    paper: list[PaperRow] = []
    for one in BUFFERS:
        if one.megabytes is not None:
            device = "the paper's picture"
            if _PAPER_SIZE in sizes:
                whole = {f"{_PAPER_SIZE}x{_PAPER_SIZE}": one.megabytes}
                paper.append(PaperRow(one.row, device, whole, MEMORY.name))
            bits = round(8 * one.megabytes * MEMORY.scale / _PAPER_SIZE**2, 3)
            small = {column: bits for size, column in zip(sizes, columns, strict=True) if size**2 <= _ONE_BAND}
            paper.append(PaperRow(one.row, device, small, PER_SAMPLE.name))
    sweep = Sweep(
        "sintorn-memory",
        "Memory",
        "Sintorn, Olsson, Assarsson 2011, section 4",
        "buffer",
        columns,
        "",
        tuple(paper),
        note=NOTE,
        quantities=(MEMORY, PER_SAMPLE),
    )
    return SweepRecord.of(sweep, cells)


def _measure(scene: Scene, size: int, column: str, clock: Clock) -> list[Cell]:
    # Close by, so that hardly a pixel is background, which takes no memory in some methods.
    camera = Camera.look_at((5.0, 10.0, 13.0), (0.5, 0.3, 1.5), fov_y=36.0, width=size, height=size)
    methods = methods_of(size)
    cells: dict[str, Cell] = {}
    for translucent in (False, True):
        seen = scene if translucent else scene.opaque()
        rows = [one for one in BUFFERS if one.translucent == translucent]
        samples = sample(seen, camera)
        for name in dict.fromkeys(one.method for one in rows):
            counted, missing = _stats(seen, methods[name], samples)
            for one in (one for one in rows if one.method == name):
                cells[one.row] = Cell(one.row, column, counters=_told(counted, one, samples.size), not_run=missing)
            clock.advance(len(cells), len(BUFFERS))
    return [cells[one.row] for one in BUFFERS]


def _told(counted: Mapping[str, int], buffer: Buffer, samples: int) -> dict[str, int]:
    if buffer.counter not in counted:
        return {}
    found = {"bytes": counted[buffer.counter]}
    if samples <= _ONE_BAND:
        found["bits_of_a_million_samples"] = round(8e6 * found["bytes"] / samples)
    return found


def _stats(scene: Scene, method: Method, samples: ViewSamples) -> tuple[Mapping[str, int], str | None]:
    """What a mask counted, or why there is none."""
    try:
        return method.prepare(scene).shadow(LIGHT, samples).stats, None
    except UmbraeError as error:
        return {}, str(error)
