"""How commands fail: one line on the standard error, a documented exit code, and never a traceback.

A command that was given `--json` also says it in one JSON object on the standard output.

RTSHCUA_DEBUG=1 shows the traceback of an internal fault.
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

_json = ContextVar("json", default=False)  # whether this command was asked for JSON


#: errors that are told with the slug of their exit code, where they have none of their own
_NAMED = (ExitCode.USAGE, ExitCode.INPUT, ExitCode.UNTRUSTED)


@contextmanager
def as_json(*, wanted: bool) -> Iterator[None]:
    """Within this, `fail` also prints {"error": {"slug", "text", "help"}, "exit_code"}, if that is wanted."""
    before = _json.set(wanted)
    try:
        yield
    finally:
        _json.reset(before)


def fail(
    code: ExitCode, message: str, help: str | None = None, *, slug: str | None = None, usage: str | None = None
) -> ExitCode:
    """Says `message` (and `help`) on the standard error, and gives `code` back: `return fail(ExitCode.INPUT, ...)`.

    `slug` is given where there is a more exact one than the exit code's own; `usage` is how the command is called.
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
    """The one form of errors for programs, whatever stands beside it: `help` is null where there is none."""
    error = {"slug": slug or code.slug, "text": text, "help": help or None}
    return {"error": error | ({} if at is None else {"at": at}), "exit_code": int(code)}


def misaddressed(option: str, error: "AddressError") -> ExitCode:
    """Fails for an option's address: what is wrong, the address with that part marked below, and what is accepted."""
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
    """Fails for something that is not to be trusted; `where` says what it was, before the text."""
    return refuse(Refusal(error.slug, f"{where}{error}", help or remedy(error)))


def refuse(refusal: Refusal, code: ExitCode | None = None) -> ExitCode:
    """Fails with a refusal, and with the exit code of its slug unless there is another."""
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
    """How an error begins: with its slug where a person may look it up, or tell somebody of it."""
    slug = slug or code.slug
    return f"error[{slug}]" if slug != code.slug or code in _NAMED else "error"


def _print_object(told: Mapping[str, object]) -> None:
    import json

    try:
        print(json.dumps(told), flush=True)
    except OSError:
        _discard("stdout")


def say(line: str) -> None:
    """Prints one line on the standard error, harmless whatever is in it, or several where it is longer than a terminal
    is wide; when even that is gone there is nobody left to tell.
    """
    from rtshcua.diagnostics.excerpt import visible
    from rtshcua.front.cli.width import fitted  # the door opens without these

    for each in fitted(visible(line)):
        _say(each)


def say_lines(text: str) -> None:
    """`say` for each line of a text of our own making."""
    for line in text.split("\n"):
        say(line)


def say_rendered(text: str) -> None:
    """Prints on the standard error what is harmless already, and may be coloured by us."""
    _say(text)


def _say(line: str) -> None:
    if sys.stderr is None:
        return  # `print` would take the standard output for it
    try:
        print(line, file=sys.stderr, flush=True)
    except OSError:
        _discard("stderr")


def barrier(command: Callable[[], int]) -> int:
    """Runs `command` and gives its exit code back, whatever rises out of it; SystemExit alone passes, if meant."""
    try:
        code = command()
        _flush()  # a full disk or a closed pipe shows here, not after the exit code is out
        return code
    except KeyboardInterrupt:
        return fail(ExitCode.INTERRUPTED, "interrupted")
    except SystemExit as end:
        if isinstance(end.__context__, BrokenPipeError):  # rich's own way of leaving when the reader has left
            return ExitCode.FULL
        raise
    except BrokenPipeError:
        return ExitCode.FULL  # quiet, for the reader left on purpose; not 0, for it may have missed the verdict
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
    """Whether it came of Ctrl-C: what is interrupted may say so by an error of its own, as `__set_name__` does."""
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
    """Fails for what the operating system would not do."""
    text, help = _words_of(error), None
    if isinstance(error, FileNotFoundError) and isinstance(error.filename, str):
        from rtshcua.app.files import missing

        text, help = missing(Path(error.filename)) or (text, None)
    return fail(exit_code_of(error), text, help)


def of_each(paths: Iterable[Path], work: Callable[[Path, bool], ExitCode]) -> ExitCode:
    """The first exit code that is not 0, of `work` on each file; it is also told which is the first. One that cannot be
    read is told, and the others come all the same.
    """
    codes = []
    for number, path in enumerate(paths):
        try:
            codes.append(work(path, number == 0))
        except OSError as error:
            if error.filename is None:
                raise  # what we write on
            codes.append(unreadable(error))
    return next((code for code in codes if code is not ExitCode.OK), ExitCode.OK)


def _words_of(error: OSError) -> str:
    """What the system says, and of which file: "no such file or directory: `x.rts`"."""
    words = words_of(error)
    return f"{words}: `{error.filename}`" if error.filename is not None else words


def _discard(name: str) -> None:
    """Points a standard stream that cannot be written any more at nothing, or exiting would fail on it again."""
    stream = getattr(sys, name)
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    except (AttributeError, OSError):
        setattr(sys, name, None)
