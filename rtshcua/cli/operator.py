"""`rtshcua operator`: follow a flight from a terminal, with its recall at hand."""

import json
import os
import select
import sys
import time
from pathlib import Path
from typing import Annotated, Final

import typer

from rtshcua.adapters.agent_socket import Answered, FlightFollower
from rtshcua.adapters.files.folders import data_folder
from rtshcua.adapters.files.keystore import KeyStore
from rtshcua.cli.document_options import ApprovalKey, AsJson, FlyingBundle, PassphraseFile, Person, SignedRoot
from rtshcua.cli.documents import MOST_S, subject
from rtshcua.cli.faults import refuse, untrusted
from rtshcua.cli.recalling import GOOD_S, HELP, Recalled
from rtshcua.cli.showing.bundle import Claimed
from rtshcua.cli.showing.log import Names
from rtshcua.cli.stdout import out, out_json
from rtshcua.cli.unlock import unlock_person
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import Decision, Effect
from rtshcua.wire.keys import SigningKey
from rtshcua.wire.untrusted import Untrusted

_HELP: Final = "recall: call this flight home · policy: all under its policy · quit: leave it flying"
#: what a person types, with Enter: what it calls home, by whether all under the policy
_RECALLS: Final = {"r": False, "recall": False, "p": True, "policy": True}
_QUITS: Final = frozenset({"q", "quit", "exit"})
_CHUNK: Final = 4_096

app = typer.Typer(add_completion=False)


@app.command()
def operator(
    bundle: FlyingBundle,
    to: Annotated[Path, typer.Option(metavar="SOCKET", help="the flight's operator or agent socket")],
    seconds: Annotated[int, typer.Option("--for", min=1, max=MOST_S, help="how many seconds a recall is good")]
    = GOOD_S,
    root: SignedRoot = None,
    person: Person = None,
    approval_key: ApprovalKey = None,
    passphrase_file: PassphraseFile = None,
    as_json: AsJson = False,
) -> ExitCode:  # fmt: skip
    """Follow a flight, and hold its recall ready: `recall` and Enter calls it home within milliseconds.

    The key is unlocked at the start, and held in memory until the end. The flight goes on when this ends.
    """
    try:
        flying = subject(bundle, [], root, time.time_ns() // 1000, stops=True)
        key = unlock_person(KeyStore(data_folder()), person, None, path=approval_key, passphrase_file=passphrase_file)
    except Untrusted as error:
        return refuse(untrusted(error))
    with FlightFollower(to) as follower:
        console = _Console(follower, Recalled(flying, follower.flight), key, seconds, as_json=as_json)
        try:
            return console.follow()
        except KeyboardInterrupt:
            console.tell("left", "the flight goes on")
            return ExitCode.OK


class _Console:
    """What a person sees and types. `seconds`: how long a recall that is sent is good."""

    def __init__(
        self, follower: FlightFollower, recalled: Recalled, key: SigningKey, seconds: int, *, as_json: bool
    ) -> None:
        self._follower = follower
        self._recalled = recalled
        self._key = key
        self._seconds = seconds
        self._as_json = as_json
        self._names: Names | None = None  # until the flight tells its mission
        self._typed = b""
        self._code = ExitCode.OK

    def follow(self) -> ExitCode:
        """Until the flight is over, or somebody leaves it."""
        self.tell("following", f"{self._recalled.name}, flight {self._follower.flight.hex()}")
        self.tell("ready", _HELP)
        watched = [self._follower.fileno(), *([] if sys.stdin is None else [sys.stdin.fileno()])]
        while True:
            ready = select.select(watched, [], [])[0]
            if watched[0] in ready and not self._hear():
                self.tell("over", "the flight hung up: it is over, or its run ended")
                return self._code
            if len(ready) > (watched[0] in ready):
                data = os.read(watched[1], _CHUNK)
                if not data:
                    del watched[1]
                    self.tell("ready", "nobody types any more: the flight is followed to its end")
                self._typed += data or (b"\n" if self._typed else b"")
                *lines, self._typed = self._typed.split(b"\n")
                for line in lines:
                    if not self._obey(line.decode(errors="replace").strip().lower()):
                        self.tell("left", "the flight goes on")
                        return self._code

    def _hear(self) -> bool:
        """Tell what the flight says; False where it hung up."""
        lines = self._follower.receive()
        for line in lines or ():
            if isinstance(line, Answered):
                accepted = line.slug == "accepted"
                self._code = ExitCode.OK if accepted else ExitCode.REFUSED
                help = HELP.get(line.slug)
                text = line.text if accepted or help is None else f"{line.text}; {help}"
                self.tell("accepted" if accepted else "refused", text if accepted else f"{text} ({line.slug})")
                continue
            record = read(line)
            if isinstance(record, Flaw):
                self._meet(line)
            elif isinstance(record, Decision | Effect):
                names = self._names or Names(None)
                names.follow(record)
                self.tell(record.event if isinstance(record, Effect) else record.outcome, names.tell(record))
        return lines is not None

    def _meet(self, line: bytes) -> None:
        """The mission that flies first, which need not be the bundle's: an agent may have handed in one of its own."""
        if self._names is not None:
            return
        try:
            told = json.loads(line)
        except (ValueError, RecursionError):
            raise ConnectionError("what listens there is no flight: it says what no flight says") from None
        if not isinstance(told, dict) or told.get("type") != "mission":
            return
        flying = self._recalled.flying
        if told.get("digest") == flying.mission_digest.hex():
            keys = flying.policy_key.kid, flying.mission_key.kid
            self._names = Names(Claimed(flying.policy, flying.mission, flying.digest, flying.policy_digest, *keys))
        else:
            self._names = Names(None)
            self.tell("other", "another mission than the bundle's flies: `policy` calls that home")

    def _obey(self, word: str) -> bool:
        """Do what was typed; False to leave."""
        if word in _QUITS:
            return False
        under_policy = _RECALLS.get(word)
        if under_policy is None:
            self.tell("ready", _HELP)
            return True
        recalled = self._recalled._replace(flight=b"") if under_policy else self._recalled
        document = recalled.sign(self._key, time.time_ns() // 1000, self._seconds)
        try:
            self._follower.hand_in(document)
        except OSError:
            self._code = ExitCode.REFUSED
            self.tell("not-sent", "the flight hung up before the recall was sent")
            return True
        self.tell("sent", f"the recall of {recalled.name}")
        return True

    def tell(self, event: str, text: str) -> None:
        """One event, in a line."""
        if self._as_json:
            out_json(json.dumps({"event": event, "text": text}, ensure_ascii=False), flush=True)
        else:
            out(
                visible(text) if text.startswith("·") or event in _OUTCOMES else f"{event:<11} {visible(text)}",
                flush=True,
            )


_OUTCOMES: Final = frozenset({"allow", "deny", "defer", "fallback"})
