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
    policy: Annotated[bool, typer.Option("--policy", help="recall all missions under its policy")] = False,
    seconds: Annotated[int, typer.Option("--for", min=1, max=MOST_S, help="validity of the recall in seconds")]
    = recalling.GOOD_S,
    to: FlightSocket = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="write the signed recall to this file")] = None,
    send: Annotated[Path | None, typer.Option(metavar="FILE", help="send a recall signed earlier")] = None,
    root: SignedRoot = None,
    flight: FlightId = None,
    person: Person = None,
    approval_key: ApprovalKey = None,
    passphrase_file: PassphraseFile = None,
    as_json: AsJson = False,
) -> ExitCode:  # fmt: skip
    """Recall a flight: the mission ends, and if the vehicle is in the air, the policy's contingency flies.

    A recall of a mission also covers its replacements. `-o FILE` signs a recall in advance, and `--send FILE --to
    SOCKET` sends it without a key. `rtshcua operator` keeps the key unlocked for an immediate recall.
    """
    return recalling.recall(
        bundle, policy=policy, seconds=seconds, to=to, output=output, send=send, root=root, flight=flight,
        person=person, approval_key=approval_key, passphrase_file=passphrase_file, as_json=as_json,
    )  # fmt: skip
