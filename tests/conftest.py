"""What all tests share: kernels compiled from today's sources, hypothesis without deadlines, and OpenGL."""

import os
import signal
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

if TYPE_CHECKING:
    from umbrae.gl.context import Session

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


if os.environ.get("PYTEST_XDIST_WORKER"):
    # Workers ignore interruptions, and so would the processes that tests start.
    signal.signal(signal.SIGINT, signal.default_int_handler)
forget_stale_kernels()
settings.register_profile("umbrae", deadline=None, derandomize=True)
settings.load_profile("umbrae")


@pytest.fixture
def opengl() -> "Session":
    """The OpenGL context. Without one a test fails; it skips only where UMBRAE_GL=off says so, and never in CI."""
    from umbrae.errors import GraphicsError
    from umbrae.gl.context import session

    try:
        return session()
    except GraphicsError as error:
        if os.environ.get("UMBRAE_GL") == "off" and not os.environ.get("CI"):
            pytest.skip(str(error))
        pytest.fail(str(error), pytrace=False)


@pytest.fixture(autouse=True)
def engine(request: pytest.FixtureRequest) -> None:
    """Tests with a parameter `method` need what that method runs on."""
    from umbrae.methods import METHODS

    parameters = request.node.callspec.params if hasattr(request.node, "callspec") else {}
    method = METHODS.get(str(parameters.get("method")))
    if method is not None and method.engine == "OpenGL":
        request.getfixturevalue("opengl")


@pytest.fixture(scope="session")
def browser() -> str:
    """A headless browser. Without one a test fails; it skips only where UMBRAE_BROWSER=off says so, and never in CI."""
    from browser import find

    found = find()
    if found is not None:
        return found
    missing = "no Chromium: on Debian, apt-get install chromium-headless-shell; UMBRAE_BROWSER names another"
    if os.environ.get("UMBRAE_BROWSER") == "off" and not os.environ.get("CI"):
        pytest.skip(missing)
    pytest.fail(missing, pytrace=False)
