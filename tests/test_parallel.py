"""Kernels compile wherever the package lies."""

import time

import pytest

from umbrae import Clock, parallel


def test_kernels_compile_where_no_cache_can_be_written(monkeypatch):
    """Numba refuses to cache what has no file, and what lies in a read-only folder of a user without a home."""
    monkeypatch.setattr(parallel, "_without_cache", [])
    assert parallel.kernels_are_cached()
    namespace = {}
    exec("def twice(x):\n    return 2 * x", namespace)
    assert parallel.kernel(namespace["twice"])(21) == 42
    assert not parallel.kernels_are_cached()


@pytest.mark.parametrize("threads", ["1", "3"])
def test_tasks_run_once_each_in_order_of_results_and_report_progress(monkeypatch, threads):
    monkeypatch.setenv("UMBRAE_THREADS", threads)
    clock, seen = Clock(), []
    clock.advance = lambda done, total: seen.append((done, total))
    assert parallel.run(lambda index: index * index, 50, clock) == [index * index for index in range(50)]
    assert seen == sorted(seen)
    assert seen[-1] == (50, 50)
    assert parallel.run(lambda index: index, 0) == []


@pytest.mark.parametrize("threads", ["1", "3"])
def test_a_failing_task_stops_the_queue_whichever_thread_meets_it(monkeypatch, threads):
    monkeypatch.setenv("UMBRAE_THREADS", threads)
    started = []

    def task(index):
        started.append(index)
        time.sleep(0.001)
        if index == 7:
            raise ValueError("seven")

    with pytest.raises(ValueError, match="seven"):
        parallel.run(task, 2000)
    assert len(started) < 100
    assert parallel.run(lambda index: index, 3) == [0, 1, 2], "the threads are free again"


def test_nested_runs_neither_hang_nor_lose_results(monkeypatch):
    monkeypatch.setenv("UMBRAE_THREADS", "3")
    rows = parallel.run(lambda row: parallel.run(lambda column: (row, column), 5), 7)
    assert rows == [[(row, column) for column in range(5)] for row in range(7)]


def test_thread_counts_that_are_no_numbers_are_passed_over(monkeypatch):
    monkeypatch.setenv("UMBRAE_THREADS", "²")
    assert parallel.thread_count() >= 1
