"""`rtshcua recall`: call a flight home."""

import time
from pathlib import Path
from typing import Annotated, Final

import typer

from rtshcua.adapters.files.folders import data_folder
from rtshcua.adapters.files.keystore import KeyStore
from rtshcua.cli.documents import (
    MOST_S,
    WHERE,
    WHOSE,
    ApprovalKey,
    AsJson,
    FlightId,
    FlightSocket,
    FlyingBundle,
    PassphraseFile,
    Person,
    SignedRoot,
    deliver,
    flight_id,
    subject,
)
from rtshcua.cli.faults import fail, refuse, untrusted
from rtshcua.cli.unlock import unlock_person
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.wire.recall import RecallDocument, sign_recall
from rtshcua.wire.untrusted import Untrusted

#: where another mission flies: one that an agent handed in has a bundle of its own
HELP: Final = {"other-mission": "`--policy` calls home whatever flies under the policy of this bundle"}

app = typer.Typer(add_completion=False)


@app.command()
def recall(
    bundle: FlyingBundle,
    policy: Annotated[bool, typer.Option("--policy", help="all that fly under its policy on this vehicle")] = False,
    seconds: Annotated[int, typer.Option("--for", min=1, max=MOST_S, help="how many seconds the recall is good")]
    = 300,
    to: FlightSocket = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="write the signed recall here")] = None,
    root: SignedRoot = None,
    flight: FlightId = None,
    person: Person = None,
    approval_key: ApprovalKey = None,
    passphrase_file: PassphraseFile = None,
    as_json: AsJson = False,
) -> ExitCode:  # fmt: skip
    """Call a flight home: the mission ends, and in the air the policy's contingency flies.

    One for the mission reaches it also when it was replaced since.
    """
    if to is None and output is None:
        return fail(ExitCode.USAGE, "the recall has to go somewhere", WHERE)
    now_us = time.time_ns() // 1000
    try:
        flying = subject(bundle, [], root, now_us, stops=True)
        vehicle = flying.policy.vehicle.identity
        flight_named = b"" if policy else flight_id(flight, to)
        if flight_named is None:
            return fail(ExitCode.USAGE, "the recall of a mission is for one flight", f"{WHOSE}, or `--policy`")
        digests = (b"", flying.policy_digest) if policy else (flying.mission_digest, b"")
        said = RecallDocument(vehicle, flight_named, *digests, now_us, now_us + seconds * 1_000_000)
        store = KeyStore(data_folder())
        key = unlock_person(store, person, None, path=approval_key, passphrase_file=passphrase_file)
        document = sign_recall(said, key)
    except Untrusted as error:
        return refuse(untrusted(error))
    name = f"all under `{flying.policy.name}`" if policy else f"`{flying.mission.name}`"
    return deliver(document, f"recalled {name} on `{vehicle}`", to=to, output=output, as_json=as_json, help=HELP)
