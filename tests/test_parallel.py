"""Kernels compile wherever the package lies."""

from umbrae import parallel


def test_kernels_compile_where_no_cache_can_be_written(monkeypatch):
    """Numba refuses to cache what has no file, and what lies in a read-only folder of a user without a home."""
    monkeypatch.setattr(parallel, "_without_cache", [])
    assert parallel.kernels_are_cached()
    namespace = {}
    exec("def twice(x):\n    return 2 * x", namespace)
    assert parallel.kernel(namespace["twice"])(21) == 42
    assert not parallel.kernels_are_cached()
