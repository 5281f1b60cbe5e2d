"""What the command line says: which logs, which archive, which time."""

from collections.abc import Callable, Iterable, Sequence
from datetime import date
from pathlib import Path
from typing import NamedTuple, TypeVar

from rtshcua.adapters.archive.folder import LogSource
from rtshcua.adapters.store.logs import begins_as_log
from rtshcua.adapters.store.runs import LOG, logs_of
from rtshcua.app.documents import no_log
from rtshcua.app.wording import moment
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.faults import fail

_EXTRAS = {"duckdb": "archive", "distributed": "cluster"}

T = TypeVar("T")


class VerifyingOptions(NamedTuple):
    """By which root logs are verified, whether decisions are derived again, by how many processes or which cluster."""

    root: str | None
    audit: bool
    jobs: int | None
    cluster: str | None
    as_json: bool


class Skipped(NamedTuple):
    """A file below a folder that is not taken in, and why."""

    path: Path
    why: str


class Given(NamedTuple):
    """The logs of a command line, and what is no log in the folders that it names."""

    logs: list[LogSource]
    skipped: list[Skipped]


def logs_in(given: Iterable[Path]) -> Given | ExitCode:
    """The logs of files, folders of runs, and folders of such folders; an exit code where there is none, told.

    A file that is named must be a log. One that only lies in a folder does not keep the others out.
    """
    found = Given([], [])
    for path in given:
        root = path if path.is_dir() else None
        below = logs_of(path)
        if not below:
            return fail(ExitCode.INPUT, f"there is no `{LOG}` in `{path}` or below it")
        for log in below:
            try:
                wrong = None if begins_as_log(log, root) else "it is not a log of this program"
            except OSError as error:
                if root is None:
                    raise
                wrong = (error.strerror or str(error)).lower()
            if wrong is None:
                found.logs.append(LogSource(log, root))
            elif root is None:
                return fail(ExitCode.INPUT, *no_log(log, log, "name logs, or folders of runs"))
            else:
                found.skipped.append(Skipped(log, wrong))
    if not found.logs:
        first = found.skipped[0]
        return fail(ExitCode.INPUT, f"`{first.path}` is not taken in: {first.why}")
    return found


def unknown(option: str, value: str | None, known: Sequence[str]) -> ExitCode | None:
    """A refusal, told, where an option was given none of the values that it knows."""
    if value is None or value in known:
        return None
    return fail(ExitCode.USAGE, f"`{option}` knows no `{value}`", f"accepted: {', '.join(known)}")


def time_of(text: str) -> int | None:
    """UTC in us of a day (its beginning) or of a time with an offset, in ISO 8601; None for what is neither."""
    try:
        day = date.fromisoformat(text)
    except ValueError:
        return moment(text)
    return (day - date(1970, 1, 1)).days * 86_400_000_000


def with_extra(work: Callable[[], T]) -> T | ExitCode:
    """What `work` gives; where a package is missing that an extra brings, an exit code, told."""
    try:
        return work()
    except ModuleNotFoundError as error:
        extra = _EXTRAS.get((error.name or "").partition(".")[0])
        if extra is None:
            raise
        help = f"`pip install '.[{extra}]'`, in the checkout, brings it"
        return fail(ExitCode.INPUT, f"this needs the package `{error.name}`, which is not installed", help)
