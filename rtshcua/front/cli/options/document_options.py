"""Options shared by the commands that sign or send a document for a flight."""

from pathlib import Path
from typing import Annotated

import typer

FlyingBundle = Annotated[Path, typer.Argument(help="the bundle that is flying")]
FlightSocket = Annotated[Path | None, typer.Option(metavar="SOCKET", help="the flight's operator or agent socket")]
FlightId = Annotated[
    str | None, typer.Option(metavar="ID", help="the flight, as its id or one of its sockets [default: --to]")
]
Person = Annotated[
    str | None, typer.Option("--as", metavar="NAME", help="your name, if the key store has keys of several people")
]
SignedRoot = Annotated[Path | None, typer.Option(help="the signed trust root (default: the key store's)")]
ApprovalKey = Annotated[Path | None, typer.Option(help="the approval key [default: the key store's]")]
PassphraseFile = Annotated[Path | None, typer.Option(help="file with the passphrase of the key")]
AsJson = Annotated[bool, typer.Option("--json", help="print one JSON object on standard output")]
