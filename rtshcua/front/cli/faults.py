"""Report errors of commands: one line on standard error, a documented exit code, and no traceback.

With `--json`, the error is also one JSON object on standard output. RTSHCUA_DEBUG=1 shows the traceback of an internal
fault.
"""

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING

from rtshcua.app.exit_codes import code_of, exit_code_of, remedy, words_of
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.wire.untrusted import Untrusted

if TYPE_CHECKING:
    from rtshcua.adapters.vehicle.address import AddressError

_json = ContextVar("json", default=False)  # whether `--json` is in effect


#: exit codes whose slug is printed if the error has no slug of its own
_NAMED = (ExitCode.USAGE, ExitCode.INPUT, ExitCode.UNTRUSTED)


@contextmanager
def as_json(*, wanted: bool) -> Iterator[None]:
    """Within this context, `fail` also prints {"error": {"slug", "text", "help"}, "exit_code"} if `wanted`."""
    before = _json.set(wanted)
    try:
        yield
    finally:
        _json.reset(before)


def fail(
    code: ExitCode, message: str, help: str | None = None, *, slug: str | None = None, usage: str | None = None
) -> ExitCode:
    """Print `message` and `help` on standard error and return `code`: `return fail(ExitCode.INPUT, ...)`.

    `slug`: a more specific one than the exit code's; `usage`: the usage line of the command.
    """
    if _json.get():
        _print_object(error_object(code, message, help, slug=slug))
    return tell(code, message, help, slug=slug, usage=usage)


def error_object(
    code: ExitCode,
    text: str,
    help: str | None,
    *,
    slug: str | None = None,
    at: Mapping[str, str | int] | None = None,
) -> dict[str, object]:
    """Return the common JSON form of errors; `help` is null if there is none."""
    error = {"slug": slug or code.slug, "text": text, "help": help or None}
    return {"error": error | ({} if at is None else {"at": at}), "exit_code": int(code)}


def misaddressed(option: str, error: "AddressError") -> ExitCode:
    """Report an invalid address of an option, with the wrong part marked, and return the exit code."""
    from rtshcua.diagnostics.excerpt import visible

    span: dict[str, str | int] = {"option": option, "value": error.address, "start": error.start, "end": error.end}
    if _json.get():
        _print_object(error_object(ExitCode.USAGE, error.text, error.help, at=span))
    say(f"{_head(ExitCode.USAGE)}: {error.text}")
    say(f"   --> {option}")
    say(f"    | {error.address}")
    width = len(visible(error.address[: error.start]))
    say(f"    | {' ' * width}{'^' * max(1, len(visible(error.address[error.start : error.end])))}")
    say(f" help: {error.help}")
    return ExitCode.USAGE


def distrust(error: Untrusted, help: str = "", *, where: str = "") -> ExitCode:
    """Report an untrusted input and return the exit code; `where` is put before the text."""
    return refuse(Refusal(error.slug, f"{where}{error}", help or remedy(error)))


def refuse(refusal: Refusal, code: ExitCode | None = None) -> ExitCode:
    """Report a refusal and return `code`, its own exit code, or that of its slug."""
    return fail(code or refusal.code or code_of(refusal.slug), refusal.text, refusal.help, slug=refusal.slug)


def tell(
    code: ExitCode, message: str, help: str | None = None, *, slug: str | None = None, usage: str | None = None
) -> ExitCode:
    """Print an error as text only, for commands that print their own JSON."""
    say(f"{_head(code, slug)}: {message}")
    if usage:
        say_lines(f"usage: {usage}")
    if help:
        say(f" help: {help}")
    return code


def _head(code: ExitCode, slug: str | None = None) -> str:
    """Return the beginning of an error line, with its slug if it is worth showing."""
    slug = slug or code.slug
    return f"error[{slug}]" if slug != code.slug or code in _NAMED else "error"


def _print_object(told: Mapping[str, object]) -> None:
    import json

    try:
        print(json.dumps(told), flush=True)
    except OSError:
        _discard("stdout")


def say(line: str) -> None:
    """Print a line on standard error, escaped and wrapped; errors in writing are ignored."""
    from rtshcua.diagnostics.excerpt import visible
    from rtshcua.front.cli.width import fitted  # not needed at start-up

    for each in fitted(visible(line)):
        _say(each)


def say_lines(text: str) -> None:
    """Call `say` for each line of a trusted text."""
    for line in text.split("\n"):
        say(line)


def say_rendered(text: str) -> None:
    """Print an already escaped text on standard error; it may contain our colours."""
    _say(text)


def _say(line: str) -> None:
    if sys.stderr is None:
        return  # `print` would take the standard output for it
    try:
        print(line, file=sys.stderr, flush=True)
    except OSError:
        _discard("stderr")


def barrier(command: Callable[[], int]) -> int:
    """Run `command` and return its exit code, whatever exception it raises; only SystemExit may pass."""
    try:
        code = command()
        _flush()  # a full disk or a closed pipe shows here, not after the exit code is out
        return code
    except KeyboardInterrupt:
        return fail(ExitCode.INTERRUPTED, "interrupted")
    except SystemExit as end:
        if isinstance(end.__context__, BrokenPipeError):  # rich exits this way if the reader has closed the pipe
            return ExitCode.FULL
        raise
    except BrokenPipeError:
        return (
            ExitCode.FULL
        )  # no message, because the reader closed the pipe; not 0, because it may have missed the result
    except OSError as error:
        return unreadable(error)
    except Untrusted as error:
        return distrust(error)
    except Exception as error:  # noqa: BLE001  the barrier is the one place that may catch everything
        if _interrupted(error):
            return fail(ExitCode.INTERRUPTED, "interrupted")
        return _fault(error)
    finally:
        try:
            _flush()
        except OSError:
            _discard("stdout")


def _interrupted(error: BaseException | None) -> bool:
    """Return whether Ctrl-C caused the error; interrupted code may raise another error, as `__set_name__` does."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _fault(error: Exception) -> ExitCode:
    what = " ".join(f"{type(error).__name__}: {error}".split())
    message = f"internal fault, please report it: {what}"
    if os.environ.get("RTSHCUA_DEBUG") == "1":
        import traceback

        say_lines("".join(traceback.format_exception(error)).rstrip())
        return fail(ExitCode.FAULT, message)
    return fail(ExitCode.FAULT, message, "RTSHCUA_DEBUG=1 shows where it happened")


def _flush() -> None:
    if sys.stdout is not None:
        sys.stdout.flush()


def unreadable(error: OSError) -> ExitCode:
    """Report an error of the operating system and return the exit code."""
    text, help = _words_of(error), None
    if isinstance(error, FileNotFoundError) and isinstance(error.filename, str):
        from rtshcua.app.files import missing

        text, help = missing(Path(error.filename)) or (text, None)
    return fail(exit_code_of(error), text, help)


def of_each(paths: Iterable[Path], work: Callable[[Path, bool], ExitCode]) -> ExitCode:
    """Run `work` on each path and return the first exit code that is not 0.

    `work` also receives whether the path is the first. An unreadable file is reported, and the others follow.
    """
    codes = []
    for number, path in enumerate(paths):
        try:
            codes.append(work(path, number == 0))
        except OSError as error:
            if error.filename is None:
                raise  # our own output failed
            codes.append(unreadable(error))
    return next((code for code in codes if code is not ExitCode.OK), ExitCode.OK)


def _words_of(error: OSError) -> str:
    """Return the system's error text with the file: "no such file or directory: `x.rts`"."""
    words = words_of(error)
    return f"{words}: `{error.filename}`" if error.filename is not None else words


def _discard(name: str) -> None:
    """Redirect a broken standard stream to the null device, so that the exit does not fail on it again."""
    stream = getattr(sys, name)
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    except (AttributeError, OSError):
        setattr(sys, name, None)
