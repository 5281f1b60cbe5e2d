"""Print the refusal of a flight that did not start."""

import json

from rtshcua.app.exit_codes import code_of
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import error_object, fail, tell
from rtshcua.front.cli.stdout import out_json


def say_refused(refusal: Refusal, *, as_json: bool) -> ExitCode:
    """Print a refusal and return its exit code; with `as_json` print it also as a JSON event."""
    slug, text, help, code = refusal
    code = code or code_of(slug)
    if not as_json:
        return fail(code, text, help, slug=slug)
    event: dict[str, object] = {"event": "refused", "slug": slug, "text": text, "help": help or None}
    out_json(json.dumps(event | error_object(code, text, help, slug=slug), ensure_ascii=False))
    return tell(code, text, help, slug=slug)
