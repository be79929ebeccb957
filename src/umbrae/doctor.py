"""What works here: versions, memory, OpenGL and its limits, each method on a tiny scene, what could be added."""

import dataclasses
import os
import platform
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from umbrae.clock import Clock
from umbrae.console import one_line
from umbrae.errors import GraphicsError, UmbraeError
from umbrae.gl.context import Session, session
from umbrae.memory import available_bytes
from umbrae.methods import METHODS
from umbrae.parallel import kernels_are_cached, thread_count
from umbrae.warmup import try_out

EXTRAS = {
    "gl": ("moderngl", "PyOpenGL"),
    "sun": ("pvlib", "pandas", "cmap"),
    "bench": ("mitsuba", "embreex"),
    "cuda": ("warp-lang",),
    "pyvista": ("pyvista",),
    "video": ("imageio", "av"),
}
"""Optional packages by the extra that brings them, as in pyproject.toml."""
_SUBGROUP_SIZE = 0x9532  # GL_SUBGROUP_SIZE_KHR
_NO_SUCH_CAPABILITY = 0


@dataclass(frozen=True)
class OpenGL:
    """The driver, and those of its limits that matter here.

    Attributes
    ----------
    vendor, renderer, version
        What the driver calls itself.
    subgroup_size
        Invocations that compute shaders run in step; None where the driver does not tell.
    max_texture_px, max_patch_vertices, max_tessellation_level, max_storage_bytes
        Largest side of a picture, patch, tessellation level and storage buffer.
    subpixel_bits
        Of the grid that vertices are rounded to: they decide how wide bands are.
    fp64
        Whether shaders have double precision.
    debug_output
        Whether errors are heard: one made on purpose was.
    """

    vendor: str
    renderer: str
    version: str
    subgroup_size: int | None
    max_texture_px: int
    max_patch_vertices: int
    max_tessellation_level: int
    max_storage_bytes: int
    subpixel_bits: int
    fp64: bool
    debug_output: bool


@dataclass(frozen=True)
class Report:
    """What was found; `opengl` is the reason in words where there is none, `methods` hold None where one works."""

    python: str
    system: str
    numpy: str
    numba: str
    threads: int
    memory_bytes: int
    kernels_are_cached: bool
    opengl_way: str
    opengl: OpenGL | str
    methods: dict[str, str | None]
    extras: dict[str, dict[str, str | None]]

    @property
    def works(self) -> bool:
        """Whether all methods do that need nothing but the CPU."""
        return not any(self.methods[name] for name, method in METHODS.items() if method.engine == "CPU")

    def as_dict(self) -> dict[str, Any]:
        """All of it as plain numbers, texts and dictionaries."""
        return dataclasses.asdict(self) | {"works": self.works}


def examine(clock: Clock) -> Report:
    """Look at everything; each method renders next to nothing."""
    opengl: OpenGL | str
    with clock.span("OpenGL"):
        try:
            opengl = _opengl()
        except GraphicsError as error:
            opengl = one_line(str(error))
    hindrances = try_out([method() for method in METHODS.values()], 1, clock)
    return Report(
        python=platform.python_version(),
        system=f"{platform.system()} {platform.machine()}",
        numpy=version("numpy"),
        numba=version("numba"),
        threads=thread_count(),
        memory_bytes=available_bytes(),
        kernels_are_cached=kernels_are_cached(),
        opengl_way=os.environ.get("UMBRAE_GL", "egl"),
        opengl=opengl,
        methods={name: _reason(hindrance) for name, hindrance in zip(METHODS, hindrances, strict=True)},
        extras={extra: {package: _version(package) for package in packages} for extra, packages in EXTRAS.items()},
    )


def show(report: Report, console: Console) -> None:
    """The report as a table of what and how."""
    rows = Table(box=None, show_header=False, pad_edge=False)
    rows.add_column(no_wrap=True, style="bold")
    rows.add_column(overflow="fold")
    for name, value in _rows(report):
        rows.add_row(name, Text(value))  # not markup: extras stand in brackets
    console.print(rows)


def _rows(report: Report) -> Iterator[tuple[str, str]]:
    yield "python", f"{report.python} on {report.system}"
    yield "numpy, numba", f"{report.numpy}, {report.numba}"
    yield "threads", f"{report.threads}"
    yield "memory", f"{report.memory_bytes / 2**30:,.1f} GiB available"
    without_cache = "compiled at each start: NUMBA_CACHE_DIR can name a folder for them"
    yield "kernels", "kept on disk" if report.kernels_are_cached else without_cache
    yield "", ""
    yield "OpenGL", f"through {report.opengl_way} (UMBRAE_GL)"
    yield from _driver(report.opengl) if isinstance(report.opengl, OpenGL) else [("  missing", report.opengl)]
    yield "", ""
    yield "methods", "on a tiny scene"
    for name, reason in report.methods.items():
        yield f"  {name}", reason or "ok"
    yield "", ""
    yield "extras", ""
    for extra, packages in report.extras.items():
        text = ", ".join(f"{package} {found or 'is missing'}" for package, found in packages.items())
        yield f"  {extra}", text if all(packages.values()) else f"{text}; pip install 'umbrae[{extra}]'"


def _driver(found: OpenGL) -> Iterator[tuple[str, str]]:
    yield "  driver", f"{found.renderer}, {found.vendor}"
    yield "  version", found.version
    yield "  subgroups", "unknown" if found.subgroup_size is None else f"of {found.subgroup_size}"
    yield "  pictures", f"up to {found.max_texture_px:,} pixels a side"
    yield "  patches", f"up to {found.max_patch_vertices} vertices, tessellation up to {found.max_tessellation_level}"
    yield "  storage", f"up to {found.max_storage_bytes / 2**20:,.0f} MiB in a buffer"
    yield "  precision", f"{found.subpixel_bits} subpixel bits, {'double' if found.fp64 else 'no double'} precision"
    yield "  debug output", "errors are heard" if found.debug_output else "silent: errors would go unnoticed"


def _opengl() -> OpenGL:
    with session().current() as current:
        gl = current.gl
        subgroup = np.zeros(1, np.int32)
        extensions = {_text(gl.glGetStringi(gl.GL_EXTENSIONS, i)) for i in range(current.integer("GL_NUM_EXTENSIONS"))}
        if "GL_KHR_shader_subgroup" in extensions:
            gl.glGetIntegerv(_SUBGROUP_SIZE, subgroup)
        return OpenGL(
            vendor=_text(gl.glGetString(gl.GL_VENDOR)),
            renderer=_text(gl.glGetString(gl.GL_RENDERER)),
            version=_text(gl.glGetString(gl.GL_VERSION)),
            subgroup_size=int(subgroup[0]) or None,
            max_texture_px=current.integer("GL_MAX_TEXTURE_SIZE"),
            max_patch_vertices=current.integer("GL_MAX_PATCH_VERTICES"),
            max_tessellation_level=current.integer("GL_MAX_TESS_GEN_LEVEL"),
            max_storage_bytes=current.integer("GL_MAX_SHADER_STORAGE_BLOCK_SIZE"),
            subpixel_bits=current.integer("GL_SUBPIXEL_BITS"),
            fp64="GL_ARB_gpu_shader_fp64" in extensions,
            debug_output=_errors_are_heard(current),
        )


def _errors_are_heard(current: Session) -> bool:
    """Make an error; whether the driver's message arrives."""
    current.check()
    current.gl.glEnable(_NO_SUCH_CAPABILITY)
    heard = bool(current.messages)
    current.messages.clear()
    return heard


def _reason(hindrance: Exception | None) -> str | None:
    if hindrance is None or isinstance(hindrance, UmbraeError):
        return None if hindrance is None else one_line(str(hindrance))
    return one_line(f"{type(hindrance).__name__}: {hindrance}")


def _text(value: Any) -> str:
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
