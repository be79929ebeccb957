"""The command line: arguments in, the library called, results out.

Results (paths, tables, one JSON object with `--json`) go to stdout; stages, progress, notes, errors to
stderr. Exit status: 0 done; 1 `verify` or `bench` found a wrong sample, `doctor` that nothing works; 2 bad input, too
little memory, or no OpenGL where it is needed; 70 a bug in Umbrae; 130 interrupted; 143 terminated.
"""

import errno
import os
import signal
import sys
import warnings
from collections.abc import Sequence
from typing import Annotated, Any, NoReturn

import typer

import umbrae as um
from umbrae.bench import commands as bench
from umbrae.commands import about, scenes
from umbrae.commands.render import render
from umbrae.commands.sun import sun
from umbrae.commands.verify import verify
from umbrae.console import note, one_line
from umbrae.errors import RecentredWarning, UmbraeError

app = typer.Typer(
    help="Exact shadows of arbitrary triangle soups.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
app.command()(render)
app.command("info")(about.info_command)
app.command()(verify)
app.command()(sun)
app.command()(about.methods)
app.command("doctor")(about.doctor_command)
app.add_typer(scenes.app, name="scene", help="Write one of the scenes that Umbrae makes itself.")
app.add_typer(bench.app, name="bench", help="Measure Umbrae beside Embree.")


@app.callback(invoke_without_command=True)
def umbrae(version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False) -> None:
    """Exact shadows of arbitrary triangle soups."""
    if version:
        print(f"umbrae {um.__version__}")
        raise typer.Exit


def main() -> NoReturn:
    """Entry point of the `umbrae` command."""
    signal.signal(signal.SIGTERM, _terminate)
    status = run(sys.argv[1:])
    if status in (130, 143):
        # Without waiting for a kernel that is being compiled in another thread.
        os._exit(status)
    sys.exit(status)


def run(texts: Sequence[str]) -> int:
    """Carry out one command line; returns the exit status, whatever happens."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.simplefilter("always", UserWarning)
            warnings.showwarning = _show_warning
            status = app(list(texts) or ["--help"], standalone_mode=False, prog_name="umbrae")
        if sys.stdout is not None:
            sys.stdout.flush()
    except UmbraeError as error:
        return _fail(str(error), 2)
    except typer.TyperException as error:
        return _fail(error.format_message(), 2)
    except (KeyboardInterrupt, typer.Abort):
        status = 130
    except _Terminated:
        return _fail("terminated", 143)
    except SystemExit:
        # What typer makes of a reader of stdout that has gone, such as `head`.
        return 1
    except MemoryError as error:
        return _fail(f"out of memory: {str(error) or 'a smaller --size needs less'}", 2)
    except Exception as error:
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EIO, errno.EBADF):
            # Files have errors of their own: this is stdout, which must not be tried again on the way out.
            sys.stdout = None
            return _fail(f"cannot print the results: {error.strerror}", 2)
        if os.environ.get("UMBRAE_DEBUG"):
            raise
        return _fail(f"{type(error).__name__}: {error} (a bug; UMBRAE_DEBUG=1 shows the traceback)", 70)
    # typer returns 130, too.
    return _fail("interrupted", 130) if status == 130 else int(status or 0)


class _Terminated(BaseException):
    """SIGTERM, as an exception: half-written files are removed on its way out."""


def _terminate(*_: Any) -> NoReturn:
    raise _Terminated


def _show_warning(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    if issubclass(category, RecentredWarning):
        message = "coordinates far from zero: recentred inside; options stay in the file's own coordinates"
    note(str(message))


def _fail(text: str, status: int) -> int:
    print(f"umbrae: error: {one_line(text)}", file=sys.stderr)
    return status
