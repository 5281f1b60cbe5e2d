"""The options that the commands share which sign or hand in a document for a flight."""

from pathlib import Path
from typing import Annotated

import typer

FlyingBundle = Annotated[Path, typer.Argument(help="the bundle that flies")]
FlightSocket = Annotated[Path | None, typer.Option(metavar="SOCKET", help="the flight's operator or agent socket")]
FlightId = Annotated[
    str | None, typer.Option(metavar="ID", help="the flight: its id, or a socket of it [default: --to]")
]
Person = Annotated[
    str | None, typer.Option("--as", metavar="NAME", help="who you are, where the key store has several people")
]
SignedRoot = Annotated[Path | None, typer.Option(help="the signed trust root (the key store's)")]
ApprovalKey = Annotated[Path | None, typer.Option(help="the approval key [default: the key store's]")]
PassphraseFile = Annotated[Path | None, typer.Option(help="a file with the key's passphrase")]
AsJson = Annotated[bool, typer.Option("--json", help="one JSON object on the standard output")]
