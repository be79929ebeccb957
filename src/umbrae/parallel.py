"""Compiled kernels on all cores: one decorator and one loop.

Kernels release the interpreter lock and run on a pool of plain threads, task by task from a shared queue. Compared
with Numba's own `prange` this balances uneven tasks, compiles in a fraction of the time, nests safely, reports
progress and can be interrupted between tasks.
"""

import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import lru_cache
from threading import Lock, local
from typing import Any

from numba import njit

from umbrae.clock import Clock


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function with Numba: no interpreter lock, cached on disk, IEEE arithmetic as written (no fastmath)."""
    return _compiled(function)


def inline(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a small function that kernels call; LLVM inlines it."""
    return _compiled(function, inline="never")


def expand(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function that is always copied into its caller, so that loops which call it become vector code.

    It allocates nothing and returns no array, so that it need not count references to the arrays it is given: each
    would be an atomic operation, on memory that all threads share.
    """
    return _compiled(function, forceinline=True, _nrt=False)


def kernels_are_cached() -> bool:
    """Whether compiled kernels are kept on disk for later starts."""
    return not _without_cache


_without_cache: list[str] = []


def _compiled(function: Callable[..., Any], **options: Any) -> Callable[..., Any]:
    compiled: Callable[..., Any]
    # Given always: what is left open, Numba takes from whichever function happens to call first.
    options = {"forceinline": False, "_nrt": True, **options}
    try:
        compiled = njit(cache=True, nogil=True, error_model="numpy", **options)(function)
    except RuntimeError:
        # Neither the package's folder nor the user's cache folder can be written: each start compiles anew.
        _without_cache.append(function.__name__)
        compiled = njit(nogil=True, error_model="numpy", **options)(function)
    return compiled


def thread_count() -> int:
    """Number of worker threads: `UMBRAE_THREADS`, else the cores this process may use."""
    wanted = os.environ.get("UMBRAE_THREADS", "")
    if wanted.isdecimal() and int(wanted) > 0:
        return int(wanted)
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@lru_cache(maxsize=4)
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="umbrae")


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)  # a forked child has no threads but the one that forked


class _Here(local):
    """Of the current thread: whether it is working on a task."""

    busy = False


_here = _Here()


def run(task: Callable[[int], Any], count: int, clock: Clock | None = None) -> list[Any]:
    """Call `task(0) … task(count - 1)` from all threads, in order of the index, and return the results in order.

    The calling thread works too, and reports progress to `clock`. An exception, or an interruption of the calling
    thread, stops the queue: tasks under way finish, no new one starts. A task that calls `run` goes on alone: all
    threads are taken, some perhaps by tasks that wait for this one.
    """
    results: list[Any] = [None] * count
    lock = Lock()
    next_index = 0
    finished = 0
    stopped = False

    def worker(clock: Clock | None = None) -> None:
        nonlocal next_index, finished, stopped
        nested, _here.busy = _here.busy, True
        try:
            while not stopped:
                with lock:
                    index = next_index
                    next_index += 1
                if index >= count:
                    return
                results[index] = task(index)
                with lock:
                    finished += 1
                if clock is not None:
                    clock.advance(finished, count)
        except BaseException:
            stopped = True
            raise
        finally:
            _here.busy = nested

    helpers = 0 if _here.busy else min(thread_count(), count) - 1
    pending: list[Future[None]] = []
    try:
        for _ in range(helpers):
            pending.append(_pool(thread_count() - 1).submit(worker))
        worker(clock)
        for future in pending:
            # One that has not begun waits behind another run, and would find nothing left to do.
            if not future.cancel():
                future.result()
    finally:
        stopped = True
        wait(pending)
    if clock is not None and helpers > 0:
        clock.advance(count, count)
    return results
