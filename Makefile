# make demo    a picture with exact shadows, from nothing      make test    all tests
# make check   all that, formatting, lint, types, Embree       make clean   remove what the others made
PYTHON ?= python3
# The view and the sun of models.pavilion_camera() and pavilion_light().
PAVILION = --eye 7,7.4,25 --target 0.2,0.6,0.6 --fov 36 --sun 238,32 --samples-per-pixel 4

# For the tests alone: where no driver gives OpenGL 4.5, Mesa's renders on the CPU.
GL_PACKAGES = libegl1 libopengl0 libgl1-mesa-dri
# For one test file: a browser that looks at the page of umbrae bench report.
BROWSER_PACKAGES = chromium-headless-shell

.PHONY: demo test check opengl browser clean clean-kernels

demo: .venv/.installed
	@mkdir -p out
	.venv/bin/umbrae scene pavilion -o out/pavilion.glb
	.venv/bin/umbrae render out/pavilion.glb -o out/pavilion.png --mask out/pavilion_mask.png $(PAVILION)

test: .venv/.installed-dev opengl browser
	.venv/bin/pytest -q -n 2 --dist worksteal

check: .venv/.installed-dev opengl browser
	.venv/bin/ruff format --check
	.venv/bin/ruff check
	.venv/bin/mypy
	.venv/bin/pytest -q -n 2 --dist worksteal
	.venv/bin/umbrae bench check

# Never fails: tests that find no OpenGL say what is missing.
opengl: .venv/.installed-dev
	@if [ "$$UMBRAE_GL" = off ] || .venv/bin/python -c 'from umbrae.gl.context import session; session()' 2> /dev/null; \
	then :; elif ! command -v apt-get > /dev/null; \
	then echo 'OpenGL 4.5 is missing: install libEGL, libOpenGL and a driver, such as those of Mesa' >&2; \
	elif [ "$$(id -u)" -ne 0 ]; \
	then echo 'OpenGL 4.5 is missing; run: sudo apt-get install $(GL_PACKAGES)' >&2; \
	else export DEBIAN_FRONTEND=noninteractive; \
	    get() { apt-get -q update && apt-get -q install -y --no-install-recommends $(GL_PACKAGES); }; \
	    get || { sleep 5; get; } || echo 'OpenGL 4.5 is missing, and could not be installed: $(GL_PACKAGES)' >&2; \
	fi

# Never fails, as above.
browser: .venv/.installed-dev
	@if [ "$$UMBRAE_BROWSER" = off ] || (cd tests && ../.venv/bin/python -c 'import browser; exit(not browser.find())'); \
	then :; elif ! command -v apt-get > /dev/null; \
	then echo 'No Chromium is there for tests of a page: install it, or set UMBRAE_BROWSER=off' >&2; \
	elif [ "$$(id -u)" -ne 0 ]; \
	then echo 'No Chromium is there for tests of a page; run: sudo apt-get install $(BROWSER_PACKAGES)' >&2; \
	else export DEBIAN_FRONTEND=noninteractive; \
	    get() { apt-get -q update && apt-get -q install -y --no-install-recommends $(BROWSER_PACKAGES); }; \
	    get || { sleep 5; get; } || echo 'Chromium is missing, and could not be installed: $(BROWSER_PACKAGES)' >&2; \
	fi

clean:
	rm -rf .venv out dist build tests/failures .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find src tests examples -name __pycache__ -type d -prune -exec rm -rf {} +

clean-kernels:
	find src -name '*.nb[ic]' -delete

.venv/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo 'Umbrae needs Python 3.11 or newer; choose one with: make PYTHON=/path/to/python3.11' >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' || \
	    { echo 'Umbrae needs the venv module; on Debian: apt install python3-venv' >&2; exit 1; }
	$(PYTHON) -m venv .venv

.venv/.installed: pyproject.toml | .venv/bin/python
	.venv/bin/python -m pip install --quiet --disable-pip-version-check -e .
	touch $@

.venv/.installed-dev: pyproject.toml | .venv/bin/python
	.venv/bin/python -m pip install --quiet --disable-pip-version-check -e '.[dev]'
	touch $@ .venv/.installed
