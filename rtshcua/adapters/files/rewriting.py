"""Replacing what a file says, in one step: whatever happens meanwhile, it has either the old text or the new one."""

import errno
import os
import stat
from contextlib import suppress
from pathlib import Path
from tempfile import mkstemp

from rtshcua.adapters.files.durable import naming, sync_folder, write_all


class Changed(OSError):
    """The file was written by somebody else meanwhile, so it is left alone."""


def rewrite(path: Path, before: bytes, data: bytes) -> None:
    """Puts `data` where `before` was. A symbolic link stays one, a hard link is parted from the others. Permissions
    stay, and owner and group where we may.

    Raises NotWritten where nobody may write to the file or its folder, Changed where it no longer says `before`, and
    OSError for what else the system refuses; then, and on Ctrl-C, the file is as it was and nothing lies beside it.
    """
    real = Path(os.path.realpath(path))
    with naming(path):
        known = real.stat()
        if not known.st_mode & (stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH) or not os.access(real, os.W_OK):
            raise PermissionError(errno.EACCES, "the file is read-only")
        handle, name = mkstemp(prefix=f".{real.name}.", suffix=".new", dir=real.parent)
        try:
            try:
                write_all(handle, data)
                with suppress(OSError, AttributeError):  # not ours to give away
                    os.chown(name, known.st_uid, known.st_gid)
                Path(name).chmod(stat.S_IMODE(known.st_mode))  # after that: giving it away takes set-id bits
                os.fsync(handle)
            finally:
                os.close(handle)
            if real.read_bytes() != before:
                raise Changed(errno.EBUSY, "it was changed meanwhile")
            Path(name).replace(real)
        except BaseException:
            with suppress(FileNotFoundError):
                Path(name).unlink()
            raise
        sync_folder(real.parent)
