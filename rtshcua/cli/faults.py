"""How commands fail: one line on the standard error, a documented exit code, and never a traceback.

RTSHCUA_DEBUG=1 shows the traceback of an internal fault.
"""

import errno
import os
import sys
from collections.abc import Callable

from rtshcua.diagnostics.exits import ExitCode

_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS, errno.EPIPE}
_LINK = {
    errno.EADDRINUSE, errno.EADDRNOTAVAIL, errno.ECONNABORTED, errno.ECONNREFUSED, errno.ECONNRESET, errno.EHOSTDOWN,
    errno.EHOSTUNREACH, errno.ENETDOWN, errno.ENETUNREACH, errno.ENOTCONN, errno.ETIMEDOUT,
}  # fmt: skip
_INPUT = {
    errno.EACCES, errno.EEXIST, errno.EISDIR, errno.ELOOP, errno.ENAMETOOLONG, errno.ENOENT, errno.ENOTDIR,
    errno.ENOTEMPTY, errno.ENXIO, errno.EPERM,
}  # fmt: skip


def fail(code: ExitCode, message: str, help: str | None = None) -> ExitCode:
    """Says `message` (and `help`) on the standard error, and gives `code` back: `return fail(ExitCode.INPUT, ...)`."""
    say(f"error: {message}")
    if help is not None:
        say(f" help: {help}")
    return code


def say(line: str) -> None:
    """Prints one line on the standard error; when even that is gone there is nobody left to tell."""
    try:
        print(line, file=sys.stderr, flush=True)
    except OSError:
        _discard("stderr")


def barrier(command: Callable[[], int]) -> int:
    """Runs `command` and gives its exit code back, whatever rises out of it; SystemExit alone passes."""
    try:
        code = command()
        _flush()  # a full disk or a closed pipe shows here, not after the exit code is out
        return code
    except KeyboardInterrupt:
        return fail(ExitCode.INTERRUPTED, "interrupted")
    except BrokenPipeError:
        return ExitCode.FULL  # quiet, for the reader left on purpose; not 0, for it may have missed the verdict
    except OSError as error:
        return fail(exit_code_of(error), _words_of(error))
    except Exception as error:  # noqa: BLE001  the barrier is the one place that may catch everything
        return _fault(error)
    finally:
        try:
            _flush()
        except OSError:
            _discard("stdout")


def _fault(error: Exception) -> ExitCode:
    what = " ".join(f"{type(error).__name__}: {error}".split())
    message = f"internal fault, please report it: {what}"
    if os.environ.get("RTSHCUA_DEBUG") == "1":
        import traceback

        say("".join(traceback.format_exception(error)).rstrip())
        return fail(ExitCode.FAULT, message)
    return fail(ExitCode.FAULT, message, "RTSHCUA_DEBUG=1 shows where it happened")


def _flush() -> None:
    if sys.stdout is not None:
        sys.stdout.flush()


def exit_code_of(error: OSError) -> ExitCode:
    """The exit code for an error of the operating system: the link, the input, or else the output."""
    if error.errno in _LINK or (isinstance(error, (ConnectionError, TimeoutError)) and error.errno not in _FULL):
        return ExitCode.LINK
    return ExitCode.INPUT if error.errno in _INPUT else ExitCode.FULL


def _words_of(error: OSError) -> str:
    """What the system says, as our messages are written: "no such file or directory: `x.rts`"."""
    words = error.strerror or str(error) or "the system gave no reason"
    words = words[:1].lower() + words[1:]
    return f"{words}: `{error.filename}`" if error.filename is not None else words


def _discard(name: str) -> None:
    """Points a standard stream that cannot be written any more at nothing, or exiting would fail on it again."""
    stream = getattr(sys, name)
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    except (AttributeError, OSError):
        setattr(sys, name, None)
