"""Paths that can be written, and files that are written whole or not at all."""

import os
import secrets
import stat
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from umbrae.checks import shown
from umbrae.errors import InputError, OutputError

AnyPath = str | os.PathLike[str]


def check_writable(path: AnyPath, extensions: Collection[str] = ()) -> None:
    """Refuse a path that cannot be written, before the work for it starts.

    Parameters
    ----------
    extensions
        Those that are allowed, such as `IMAGES`; any if empty.

    Raises
    ------
    OutputError
        For a folder that is missing or not writable, a path that is no ordinary file, or another extension.
    """
    file = as_path(path)
    if extensions and file.suffix.lower() not in extensions:
        raise OutputError(f"{file}: unknown extension {file.suffix!r}, wanted one of {' '.join(extensions)}")
    try:
        folder = Path(os.path.realpath(file)).parent
        if not folder.is_dir():
            raise OutputError(f"{file}: no such folder: {folder}")
        if file.is_dir():
            raise OutputError(f"{file}: is a folder")
        if file.exists() and not (stat.S_ISREG(file.stat().st_mode) and os.access(file, os.W_OK)):
            raise OutputError(f"{file}: cannot be overwritten")
        if not os.access(folder, os.W_OK | os.X_OK):
            raise OutputError(f"{file}: the folder {folder} is not writable")
    except (OSError, ValueError) as error:
        if isinstance(error, OutputError):
            raise
        raise OutputError(f"{file}: cannot be written: {in_a_line(error)}") from error


@contextmanager
def written_whole(path: AnyPath) -> Iterator[BinaryIO]:
    """A stream whose content appears at the path when all of it was written, and leaves nothing otherwise."""
    # Through a link to what it points to, as opening the path would.
    file = Path(os.path.realpath(path))
    part = file.with_name(f".{file.name[:100]}.{secrets.token_hex(6)}.part")
    try:
        with open(part, "xb") as stream:
            yield stream
        os.replace(part, file)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or in_a_line(error)}") from error
    finally:
        part.unlink(missing_ok=True)


def as_path(path: AnyPath) -> Path:
    """A path of what the caller gave; raises `InputError` for what is none."""
    if not isinstance(path, str | os.PathLike) or not isinstance(os.fspath(path), str):
        raise InputError(f"wanted a path, got {shown(path)}")
    return Path(path)


def in_a_line(error: BaseException) -> str:
    """What an error says, in a line that is not too long."""
    return " ".join(str(error).split())[:120]
