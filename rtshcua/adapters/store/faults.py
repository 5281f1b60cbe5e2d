"""What rises where a file is not what it must be, or cannot be written."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class NotRegular(OSError):
    """Something else than a regular file: a pipe, a device, a socket, a folder; or a link where none is followed."""


class NotWritten(PermissionError):
    """A file that may not be written where it was asked for."""


class Changed(OSError):
    """The file was written by somebody else meanwhile, so it is left alone."""


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """An error of writing names the file that was asked for, whatever the system was doing."""
    try:
        yield
    except FileExistsError as error:
        error.filename = str(path)
        raise
    except PermissionError as error:
        raise NotWritten(error.errno, error.strerror, str(path)) from None
    except OSError as error:
        if error.errno is not None:
            error.filename = str(path)
        raise
