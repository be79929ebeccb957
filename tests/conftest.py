"""What all tests share: kernels compiled from today's sources, and hypothesis without deadlines."""

from pathlib import Path

from hypothesis import settings

PACKAGE = Path(__file__).parents[1] / "src" / "umbrae"


def forget_stale_kernels() -> None:
    """Delete cached kernels that are older than some source file.

    Numba looks at the file a kernel stands in, not at the files of the functions it calls; an edit there would go
    unnoticed.
    """
    cached = list(PACKAGE.rglob("__pycache__/*.nb[ic]"))
    newest = max(path.stat().st_mtime for path in PACKAGE.rglob("*.py"))
    if cached and min(path.stat().st_mtime for path in cached) < newest:
        for path in cached:
            path.unlink(missing_ok=True)


forget_stale_kernels()
settings.register_profile("umbrae", deadline=None, derandomize=True)
settings.load_profile("umbrae")
