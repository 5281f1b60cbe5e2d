"""The value that a service returns when it refuses a request."""

from typing import NamedTuple

from rtshcua.diagnostics.exits import ExitCode


class Refusal(NamedTuple):
    """Why a request is refused. `slug` is stable, for programs. `text` says what was found and `help` what to do, for a
    person: lower case, no full stop; `help` may be empty. `code` is the exit code of a command; None means the one of
    its `slug`.
    """

    slug: str
    text: str
    help: str = ""
    code: ExitCode | None = None
