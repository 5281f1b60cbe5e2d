"""`rtshcua bind`: bind the autopilot's own log of a flight to the evidence log."""

import json
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.app.flights.bind_log import BindRequest
from rtshcua.app.flights.bind_log import bind as service
from rtshcua.app.pin import trusted
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import refuse
from rtshcua.front.cli.render.progress import counting
from rtshcua.front.cli.render.showing.bound_log import bound_rows
from rtshcua.front.cli.render.showing.page import for_terminal, named
from rtshcua.front.cli.stdout import out_json, out_rendered
from rtshcua.front.cli.unlock import unlock
from rtshcua.wire.keys import Duty, SigningKey

app = typer.Typer(add_completion=False)

_LONG = 8 << 20  # size from which progress is shown, bytes


@app.command()
def bind(
    run: Annotated[Path, typer.Argument(help="the folder of a run, or the log in it")],
    file: Annotated[Path, typer.Argument(metavar="FLIGHT", help="the autopilot's log: PX4's .ulg, ArduPilot's .bin")],
    root: Annotated[str | None, typer.Option(metavar="FILE|KEY", help="trust root or its public key [default: the key"
        " store's]")] = None,
    log_key: Annotated[Path | None, typer.Option(help="log key that signs [default: the key store's]")] = None,
    passphrase_file: Annotated[Path | None, typer.Option(help="file with the passphrase of the key")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object on standard output")] = False,
) -> ExitCode:  # fmt: skip
    """Bind the autopilot's own log of a flight to the evidence log.

    Compares the autopilot's track with the one in the telemetry, at the same times since the autopilot's boot, and
    writes a signed document beside the log: the digests of both logs, the offset of their clocks, and where they agree
    within 1 m and 100 ms. `rtshcua verify-log` verifies it. A log of another boot is refused.
    """
    pinned = trusted(root)
    if isinstance(pinned, Refusal):
        return refuse(pinned)

    def sign(store: KeyStore) -> SigningKey:
        return unlock(store, Duty.LOG, path=log_key, passphrase_file=passphrase_file)

    say = counting(quiet=False)

    def told(done: int, size: int) -> None:
        if size >= _LONG:
            say(f"reading {100 * done // size} %" if done < size else "")

    bound = service(BindRequest(run, file, pinned, sign), told)
    if isinstance(bound, Refusal):
        return refuse(bound)
    if as_json:
        about = {"document": str(bound.path), "key": bound.kid.hex(), "binding": named(bound.binding), "exit_code": 0}
        out_json(json.dumps(about))
        return ExitCode.OK
    page = for_terminal()
    page.head(f"wrote `{bound.path}`, signed by key {bound.kid.hex()}")
    bound_rows(page, bound.binding)
    out_rendered(str(page))
    return ExitCode.OK
