"""How much memory there is, asked before a large result is allocated."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from umbrae.errors import CapacityError

_GIB = 1 << 30


def available_bytes() -> int:
    """Bytes this process can still allocate: free on the machine, allowed by its control groups and its own limit."""
    return max(0, min([_machine_bytes(), *_group_bytes(), *_limit_bytes()]))


def require(size: int, what: str) -> None:
    """Refuse work that would not fit.

    Parameters
    ----------
    size
        Bytes that are about to be allocated.
    what
        What for, as the subject of the message: "a picture of 65536 x 65536 pixels".

    Raises
    ------
    CapacityError
        When fewer than `size` bytes are available; names the estimate and what there is.
    """
    available = available_bytes()
    if size > available:
        raise CapacityError(f"{what} needs {size / _GIB:.2f} GiB of memory, {available / _GIB:.2f} GiB are available")


SPARE_BYTES = 256 << 20
"""The most that is kept of one kind of scratch memory."""

_spare: dict[str, Any] = {}


def keep_spare(kind: str, arrays: Any, touched: int) -> None:
    """Keep scratch memory of `touched` bytes for the next call: fresh pages cost more than most work done in them."""
    if touched <= SPARE_BYTES:
        _spare[kind] = arrays


def take_spare(kind: str) -> Any | None:
    """Scratch memory that an earlier call has kept, if any; it then belongs to the caller."""
    return _spare.pop(kind, None)


def drop_spare() -> None:
    """Give back all scratch memory that is kept between calls."""
    _spare.clear()


def _machine_bytes() -> int:
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    except OSError:
        pass
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return sys.maxsize  # unknown: never refuse


def _limit_bytes() -> Iterator[int]:
    """What `ulimit -v` still allows."""
    try:
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        if limit != resource.RLIM_INFINITY:
            yield limit - int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    except (ImportError, OSError, ValueError):
        pass


def _group_bytes() -> Iterator[int]:
    """What each control group around this process still allows; idle file pages count as free."""
    root = Path("/sys/fs/cgroup")
    try:
        entries = Path("/proc/self/cgroup").read_text().splitlines()
    except OSError:
        return
    for entry in entries:
        _, controllers, path = entry.split(":", 2)
        if controllers == "":
            base, limit, usage, pages = root, "memory.max", "memory.current", "inactive_file"
        elif "memory" in controllers.split(","):
            base = root / "memory"
            limit, usage, pages = "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"
        else:
            continue
        # In a container the path may be the host's and not exist here; the root is then the group itself.
        group = base / path.lstrip("/")
        while True:
            try:
                allowed = int((group / limit).read_text())
                used = int((group / usage).read_text())
                stat = dict(line.split() for line in (group / "memory.stat").read_text().splitlines())
                yield allowed - used + int(stat.get(pages, 0))
            except (OSError, ValueError):  # no such group, or no limit ("max")
                pass
            if group == base or base not in group.parents:
                break
            group = group.parent
