"""`rtshcua witness`: cosign the checkpoints of logs, away from the vehicle."""

import json
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.adapters.vehicle.address import LinkCarrier
from rtshcua.app.log_witness import Say, WitnessRequest, WitnessResult, attend, open_witness
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import as_json as saying_json
from rtshcua.front.cli.faults import fail, refuse
from rtshcua.front.cli.interrupts import Stopped, StopRequest
from rtshcua.front.cli.options.addresses import address_of
from rtshcua.front.cli.stdout import out, out_json
from rtshcua.front.cli.unlock import unlock
from rtshcua.wire.keys import Duty

app = typer.Typer(add_completion=False)


@app.command()
def witness(
    paths: Annotated[list[Path] | None, typer.Argument(metavar="[LOG|FOLDER]...", help="logs, or folders with logs")]
    = None,
    connect: Annotated[
        str | None, typer.Option(metavar="udpin:HOST:PORT", help="listen for `rtshcua run --witness` at this address")
    ] = None,
    watch: Annotated[
        float | None, typer.Option(metavar="SECONDS", min=0.1, help="check the paths again at this interval")
    ] = None,
    key: Annotated[Path | None, typer.Option(help="the witness key (default: the key store's)")] = None,
    passphrase_file: Annotated[Path | None, typer.Option(help="file with the passphrase of that key")] = None,
    root: Annotated[Path | None, typer.Option(help="the signed trust root (default: the key store's)")] = None,
    state_dir: Annotated[Path | None, typer.Option(help="folder of cosigned checkpoints (the data folder)")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object for each event")] = False,
) -> ExitCode:  # fmt: skip
    """Cosign the checkpoints of logs. A witness never cosigns contradictory checkpoints; it reports them.

    The anchors of a log file are written to a file next to it. With --connect or --watch, the command runs until Ctrl-C
    or SIGTERM, and then ends with 0.
    """
    if not paths and connect is None:
        return fail(ExitCode.USAGE, "nothing to witness", "name logs or folders, or use `--connect udpin:HOST:PORT`")
    if watch is not None and not paths:
        return fail(ExitCode.USAGE, "`--watch` requires a path")
    link = None if connect is None else address_of(connect, ways=(LinkCarrier.UDP_IN,))
    if isinstance(link, ExitCode):
        return link
    request = WitnessRequest(paths or [], link, watch, root, state_dir)
    with ExitStack() as stack:
        stack.enter_context(saying_json(wanted=as_json))
        try:
            ended = _witness(request, key, passphrase_file, _saying(as_json=as_json), stack)
        except Stopped:
            return ExitCode.OK
        if isinstance(ended, Refusal):
            return refuse(ended)
        for path in ended.empty:
            fail(ExitCode.INPUT, f"no logs found in `{path}`")
        return max([ended.code, *(ExitCode.INPUT for _ in ended.empty)])


def _witness(
    request: WitnessRequest, key: Path | None, passphrase_file: Path | None, say: Say, stack: ExitStack
) -> WitnessResult | Refusal:
    own = open_witness(
        request, lambda store: unlock(store, Duty.WITNESS, path=key, passphrase_file=passphrase_file), stack
    )
    if isinstance(own, Refusal):
        return own
    stop = StopRequest()
    if request.lasts:  # otherwise a signal may end it at once: files are written atomically
        stack.enter_context(stop)
    return attend(own, request, say, stop.look, stack)


def _saying(*, as_json: bool) -> Say:
    def say(said: dict[str, object], words: str) -> None:
        if as_json:
            out_json(json.dumps(said, ensure_ascii=False), flush=True)
        else:
            out(words, flush=True)

    return say
