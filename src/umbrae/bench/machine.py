"""What a measurement was made on, without the names of people, hosts or folders."""

import os
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from umbrae.gl.context import driver
from umbrae.parallel import thread_count

PACKAGES = ("umbrae", "numpy", "numba", "llvmlite", "mitsuba", "drjit", "embreex", "warp-lang", "pyvista", "vtk")


def describe() -> dict[str, Any]:
    """Processor, memory, system, versions, commit; `sources` is git's name for its `src`, `dirty` if they differ.

    `opengl` is the driver of OpenGL, None where nothing has used it.
    """
    return {
        "cpu": _cpu(),
        "cores": os.cpu_count(),
        "threads": thread_count(),
        "memory_bytes": _memory_bytes(),
        "opengl": driver(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "versions": {name: _version(name) for name in PACKAGES},
        **_commit(),
    }


def _cpu() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _memory_bytes() -> int | None:
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return None


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _commit() -> dict[str, Any]:
    checkout = Path(__file__).parents[3]
    unknown = {"commit": None, "sources": None, "dirty": None}
    if not (checkout / ".git").exists():
        return unknown  # an installed package, perhaps inside somebody else's checkout
    try:
        commit, sources = _git(checkout, "rev-parse", "HEAD", "HEAD:src").split()
        dirty = bool(_git(checkout, "status", "--porcelain", "--", "src"))
        return {"commit": commit, "sources": sources, "dirty": dirty}
    except (OSError, ValueError, subprocess.SubprocessError):
        return unknown


def _git(checkout: Path, *words: str) -> str:
    done = subprocess.run(["git", "-C", str(checkout), *words], capture_output=True, text=True, check=True, timeout=10)
    return done.stdout.strip()
