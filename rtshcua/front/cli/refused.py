"""A flight that never began, for a person, and with `--json` for a program too."""

import json

from rtshcua.app.fly.refused import Refused
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.faults import error_object, fail, tell
from rtshcua.front.cli.stdout import out_json


def say_refused(refused: Refused, *, as_json: bool) -> ExitCode:
    """Tell why it did not; for a program an error in the one form of errors, and the same beside it."""
    if not as_json:
        return fail(refused.code, str(refused), refused.help, slug=refused.slug)
    event: dict[str, object] = {
        "event": "refused",
        "slug": refused.slug,
        "text": str(refused),
        "help": refused.help or None,
    }
    event |= error_object(refused.code, str(refused), refused.help, slug=refused.slug)
    out_json(json.dumps(event, ensure_ascii=False))
    return tell(refused.code, str(refused), refused.help, slug=refused.slug)
