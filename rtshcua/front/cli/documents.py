"""Write signed flight documents to a file or send them to the flight. No typer here: a recall must start fast."""

import json
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from rtshcua.app.flight_documents import send_document
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.faults import error_object, fail
from rtshcua.front.cli.stdout import out, out_json

NO_HELP: Mapping[str, str] = MappingProxyType({})
#: help for a missing destination
WHERE = "add `--to SOCKET` (a socket of the flight) or `--output FILE`"


def deliver(
    document: bytes,
    what: str,
    *,
    to: Path | None,
    output: Path | None,
    as_json: bool,
    help: Mapping[str, str] = NO_HELP,
) -> ExitCode:
    """Write a document to `output` or send it to the flight at `to`, and print the result.

    `help`: the hint for each slug with which the flight may refuse. Raises OSError.
    """
    said = send_document(document, to, output)
    if said is None:
        return _say(ExitCode.OK, "written", f"{what}, written to {output}", as_json=as_json)
    code = ExitCode.OK if said.slug == "accepted" else ExitCode.REFUSED
    text = f"{what}: {said.text}" if code is ExitCode.OK else f"the flight refused it: {said.text} ({said.slug})"
    return _say(code, said.slug, text, as_json=as_json, help=help.get(said.slug))


def _say(code: ExitCode, slug: str, text: str, *, as_json: bool, help: str | None = None) -> ExitCode:
    text = visible(text)  # it contains names from the mission and text from the socket, which are untrusted
    if as_json:
        error = {} if code is ExitCode.OK else error_object(code, text, help, slug=slug)
        out_json(json.dumps({"slug": slug, "text": text, "exit": code.slug} | error, ensure_ascii=False))
    elif code is ExitCode.OK:
        out(text)
    else:
        return fail(code, text, help, slug=slug)
    return code
