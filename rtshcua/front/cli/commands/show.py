"""`rtshcua show`: print the contents of a bundle, document, key, trust root or log."""

import json
import time
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.adapters.store.logs import lines
from rtshcua.adapters.store.reading import open_regular
from rtshcua.adapters.store.runs import LOG
from rtshcua.app.documents import kind_of
from rtshcua.app.logs import CUT_AT_FIRST
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.faults import distrust, fail
from rtshcua.front.cli.render.showing.bound_log import is_autopilot_binding, show_autopilot_binding
from rtshcua.front.cli.render.showing.bundle import show_bundle
from rtshcua.front.cli.render.showing.document import kind_of_document, show_document
from rtshcua.front.cli.render.showing.keys import KEY_FILE, show_key, show_root
from rtshcua.front.cli.render.showing.log import show_log
from rtshcua.front.cli.render.showing.page import TextPage, for_terminal
from rtshcua.front.cli.render.showing.qualification import is_qualification, show_qualification
from rtshcua.front.cli.stdout import out_json, out_rendered
from rtshcua.wire import cbor, cose, names
from rtshcua.wire.bundle import MAX_BUNDLE
from rtshcua.wire.untrusted import Untrusted

app = typer.Typer(add_completion=False)

_SNIFF = 1 << 12
_LOG = b'{"_prev":"'
_BUNDLE = cbor.encode(names.BUNDLE.name)
_ENVELOPE = b"\xd2"  # COSE_Sign1


@app.command()
def show(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="a bundle, document, key, trust root, qualification record or log, or a run folder"
        ),
    ],
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object on standard output")] = False,
) -> ExitCode:
    """Print the complete contents of a file. Nothing is verified."""
    page = for_terminal()
    file = path / LOG if path.is_dir() else path
    if file is not path and not file.exists():
        return fail(ExitCode.INPUT, f"no `{LOG}` in the folder `{path}`", "name a file or a run folder")
    try:
        shown = _show(page, file)
    except Untrusted as error:
        return distrust(error, where=f"`{path}`: ")
    if shown is None:
        help = "open sources in an editor; `rtshcua check` checks them"
        kind = kind_of(file)
        if kind is not None:
            return fail(ExitCode.INPUT, f"`{path}` is {kind.name}, which `show` does not support", kind.help or None)
        return fail(ExitCode.INPUT, f"`{path}` is not a bundle, document, key, trust root or log of this program", help)
    if shown["kind"] == "log" and not shown["records"]:
        return fail(ExitCode.EVIDENCE, f"`{path}`: {CUT_AT_FIRST}", slug="genesis/missing")
    if as_json:
        out_json(json.dumps(shown, ensure_ascii=False))
    else:
        out_rendered(str(page))
    return ExitCode.OK


def _show(page: TextPage, path: Path) -> dict[str, object] | None:
    """Add the contents of a file to the page and return them; None for an unknown kind. Raises `Untrusted`."""
    now_us = time.time_ns() // 1000
    with open_regular(path) as file:
        head = file.read(_SNIFF)
        file.seek(0)
        if head.startswith(_LOG):
            return show_log(page, lines(file))
        data = file.read(MAX_BUNDLE + 1)
    if head[1:].startswith(_BUNDLE):
        return show_bundle(page, data, now_us)
    if head.startswith(KEY_FILE):
        return show_key(page, data)
    if head.startswith(_ENVELOPE) and cose.unverified(data, limit=MAX_BUNDLE).content_type == names.ROOT.content_type:
        return show_root(page, data, now_us)
    if head.startswith(_ENVELOPE) and is_qualification(data):
        return show_qualification(page, data)
    if head.startswith(_ENVELOPE) and is_autopilot_binding(data):
        return show_autopilot_binding(page, data)
    return show_document(page, data) if kind_of_document(data) is not None else None
