"""The one way to say that something which was asked for is refused."""

from typing import NamedTuple

from rtshcua.diagnostics.exits import ExitCode


class Refusal(NamedTuple):
    """Why something is refused. `slug` is stable and for programs; `text` says what was found, and `help` what to do
    about it, for a person: lower case, no full stop. `help` is empty where there is nothing to add. `code` is how a
    command ends with it; None: as with any refusal of this slug.
    """

    slug: str
    text: str
    help: str = ""
    code: ExitCode | None = None
