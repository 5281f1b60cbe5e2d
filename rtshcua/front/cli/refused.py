"""A flight that does not begin."""

import json

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.faults import error_object, fail, tell
from rtshcua.front.cli.stdout import out_json


class Refused(Exception):
    """The flight does not begin: exit code, a stable slug, a text for a person, and perhaps help."""

    def __init__(self, code: ExitCode, slug: str, text: str, help: str | None = None) -> None:
        super().__init__(text)
        self.code = code
        self.slug = slug
        self.help = help

    def event(self) -> dict[str, object]:
        """The event that says so with `--json`: an error in the one form of errors, and the same beside it."""
        told = error_object(self.code, str(self), self.help, slug=self.slug)
        return {"event": "refused", "slug": self.slug, "text": str(self), "help": self.help or None} | told


def say_refused(refused: Refused, *, as_json: bool) -> ExitCode:
    """A flight that never began: for a person, and with `--json` for a program too."""
    if not as_json:
        return fail(refused.code, str(refused), refused.help, slug=refused.slug)
    out_json(json.dumps(refused.event(), ensure_ascii=False))
    return tell(refused.code, str(refused), refused.help, slug=refused.slug)
