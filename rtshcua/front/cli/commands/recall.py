"""`rtshcua recall`: call a flight home."""

from pathlib import Path
from typing import Annotated

import typer

from rtshcua.app.flight_documents import MOST_S
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import recalling
from rtshcua.front.cli.options.document_options import (
    ApprovalKey,
    AsJson,
    FlightId,
    FlightSocket,
    PassphraseFile,
    Person,
    SignedRoot,
)

app = typer.Typer(add_completion=False)


@app.command()
def recall(
    bundle: Annotated[Path | None, typer.Argument(help="the bundle that is flying")] = None,
    policy: Annotated[bool, typer.Option("--policy", help="all that fly under its policy on this vehicle")] = False,
    seconds: Annotated[int, typer.Option("--for", min=1, max=MOST_S, help="how many seconds the recall is good")]
    = recalling.GOOD_S,
    to: FlightSocket = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="write the signed recall here")] = None,
    send: Annotated[Path | None, typer.Option(metavar="FILE", help="hand in a recall that was signed before")] = None,
    root: SignedRoot = None,
    flight: FlightId = None,
    person: Person = None,
    approval_key: ApprovalKey = None,
    passphrase_file: PassphraseFile = None,
    as_json: AsJson = False,
) -> ExitCode:  # fmt: skip
    """Call a flight home: the mission ends, and in the air the policy's contingency flies.

    One for the mission reaches it also when it was replaced since. `-o FILE` signs one ahead of time, and `--send FILE
    --to SOCKET` hands it in, without a key. `rtshcua operator` holds one ready.
    """
    return recalling.recall(
        bundle, policy=policy, seconds=seconds, to=to, output=output, send=send, root=root, flight=flight,
        person=person, approval_key=approval_key, passphrase_file=passphrase_file, as_json=as_json,
    )  # fmt: skip
