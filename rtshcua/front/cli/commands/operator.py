"""`rtshcua operator`: follow a flight in a terminal, and recall it at once if needed."""

import json
import os
import select
import sys
import time
from pathlib import Path
from typing import Annotated, Final, NamedTuple

import msgspec
import typer

from rtshcua.adapters.agent_socket import FlightFollower, FlightReply
from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.app.documents import Claimed
from rtshcua.app.exit_codes import untrusted
from rtshcua.app.flight_documents import MOST_S, bundle_in_flight
from rtshcua.app.fly.narrator import REPLACED, Answering, asks
from rtshcua.app.recalls import Recalled
from rtshcua.app.telling.record_prose import Names
from rtshcua.diagnostics.excerpt import escaped, visible
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.suggest import nearest
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import Close, DecisionRecord, Effect
from rtshcua.front.cli.faults import refuse
from rtshcua.front.cli.interrupts import Stopped, StopRequest
from rtshcua.front.cli.options.document_options import (
    ApprovalKey,
    AsJson,
    FlyingBundle,
    PassphraseFile,
    Person,
    SignedRoot,
)
from rtshcua.front.cli.recalling import GOOD_S, HELP
from rtshcua.front.cli.render.live.lines import asked
from rtshcua.front.cli.stdout import NewestLines
from rtshcua.front.cli.unlock import unlock_person
from rtshcua.front.cli.width import columns, fitted
from rtshcua.model.outcome import Reason
from rtshcua.wire.bundle import Bundle
from rtshcua.wire.keys import SigningKey
from rtshcua.wire.untrusted import Untrusted

_HELP: Final = "recall: recall this flight · policy: recall all under its policy · quit: leave it flying"
#: the commands that recall, and whether each recalls all flights under the policy
_RECALLS: Final = {"r": False, "recall": False, "p": True, "policy": True}
_QUITS: Final = frozenset({"q", "quit", "exit"})
_CHUNK: Final = 4_096
#: a flight whose clock is further ahead than this is sped up, us
_AHEAD_US: Final = 5_000_000
#: how much of an unknown command is printed
_SHOWN: Final = 40

app = typer.Typer(add_completion=False)


@app.command()
def operator(
    bundle: FlyingBundle,
    to: Annotated[Path, typer.Option(metavar="SOCKET", help="the flight's operator or agent socket")],
    seconds: Annotated[int, typer.Option("--for", min=1, max=MOST_S, help="validity of a recall in seconds")]
    = GOOD_S,
    root: SignedRoot = None,
    person: Person = None,
    approval_key: ApprovalKey = None,
    passphrase_file: PassphraseFile = None,
    as_json: AsJson = False,
) -> ExitCode:  # fmt: skip
    """Follow a flight; type `recall` and Enter to recall it within milliseconds.

    The key is unlocked at the start and kept in memory until the end. The flight continues when this command ends. If
    the connection is lost, the command reconnects for up to a minute, and then repeats an unanswered recall.

    Exit codes: 0 the flight closed its log, or you quit; 5 the flight refused the last recall; 8 a recall was not
    answered, or the connection could not be restored.
    """
    try:
        flying = bundle_in_flight(bundle, [], root, time.time_ns() // 1000, stops=True)
        key = unlock_person(KeyStore(data_folder()), person, None, path=approval_key, passphrase_file=passphrase_file)
    except Untrusted as error:
        return refuse(untrusted(error))
    console = OperatorConsole(
        to, FlightFollower(to), flying, key, seconds, typing=None if sys.stdin is None else sys.stdin.fileno(),
        output=sys.stdout.fileno(), as_json=as_json, bundle=str(bundle),
    )  # fmt: skip
    try:
        with StopRequest() as stop:
            return console.follow(stop)
    finally:
        console.close()


class Patience(NamedTuple):
    """The time limits of the console, in seconds."""

    #: between two attempts to reconnect, and for each attempt
    again_s: float = 0.5
    #: for all attempts to reconnect; a run restarted after a kill is back within seconds
    lost_s: float = 60.0
    #: for the answer to a recall, before the console warns
    answer_s: float = 2.0
    #: for any record, before the console warns; a flight seals its log every 10 s
    silent_s: float = 30.0
    #: for the reader of the remaining output, at the end
    drain_s: float = 1.0


class _Told(msgspec.Struct):
    """The members read from a line that is not a record."""

    type: str = ""
    digest: str = ""


_read_told = msgspec.json.Decoder(_Told).decode


class OperatorConsole:
    """The console on the descriptors `output` and `typing`.

    `seconds`: validity of each recall; `bundle`: the file of the flying bundle, for the commands that are printed.
    Nothing blocks on a single descriptor: neither a slow flight nor a slow terminal can delay a recall.
    """

    def __init__(
        self, to: Path, follower: FlightFollower, flying: Bundle, key: SigningKey, seconds: int, *, typing: int | None,
        output: int, as_json: bool, bundle: str, patience: Patience = Patience(),
    ) -> None:  # fmt: skip
        self._to, self._bundle = to, bundle
        self._flying = flying
        self._key = key
        self._seconds = seconds
        self._as_json = as_json
        self._patience = patience
        self._follower: FlightFollower | None = follower
        self._flight = follower.flight
        self._output = NewestLines(
            output, lambda count: self._line("left-out", f"{count} lines: they were not read in time")
        )
        self._typing = typing
        self._names: Names | None = None  # None until the flight reports its mission
        self._replaced = 0
        self._typed = b""
        self._code = ExitCode.OK
        #: an unanswered recall: whether it covers all flights under the policy
        self._unanswered: bool | None = None
        self._sent_s = self._heard_s = self._lost_s = time.monotonic()
        self._told_silence = self._told_unanswered = False

    def follow(self, stop: StopRequest) -> ExitCode:
        """Run until the flight ends, the user quits (also by a signal), or the connection cannot be restored."""
        self._greet()
        self.tell("ready", _HELP)
        code: ExitCode | None = None
        try:
            while code is None:
                stop.look()
                self._output.write()
                code = self._turn()
        except Stopped:
            code = self._leave()
        self._output.drain(self._patience.drain_s)
        return code

    def close(self) -> None:
        """Close the connection."""
        if self._follower is not None:
            self._follower.close()

    def _leave(self) -> ExitCode:
        self.tell("left", "the flight continues")
        return self._left()

    def _left(self) -> ExitCode:
        return self._code if self._unanswered is None else ExitCode.LINK

    def _turn(self) -> ExitCode | None:
        """Wait for the next event and handle it; return the exit code once the flight has ended."""
        follower = self._follower
        reads = [each for each in (self._typing, follower) if each is not None]
        writes: list[NewestLines | FlightFollower] = [self._output] if self._output.waiting else []
        if follower is not None and follower.unsent:
            writes.append(follower)
        readable, writable, _ = select.select(reads, writes, [], self._patience.again_s)
        if follower is None:
            self._connect()
        else:
            try:
                if follower in writable:
                    follower.flush()
                over = follower in readable and self._hear(follower)
            except OSError as error:
                if isinstance(error, ConnectionError) and error.errno is None:
                    raise  # the peer is not a flight
                over = self._lose()
            if over:
                return self._left()
        if self._typing in readable and self._type():
            return self._leave()
        return self._wait()

    def _wait(self) -> ExitCode | None:
        """Warn about time limits that have passed; return the exit code if reconnecting took too long."""
        now_s = time.monotonic()
        if self._follower is None:
            if now_s - self._lost_s < self._patience.lost_s:
                return None
            self.tell("gone", "could not reconnect to the flight; it is unknown whether it has ended")
            return ExitCode.LINK
        if now_s - self._heard_s >= self._patience.silent_s and not self._told_silence:
            self._told_silence = True
            self.tell("silent", f"no data from the flight for {now_s - self._heard_s:.0f} s")
        waits = self._unanswered is not None and now_s - self._sent_s >= self._patience.answer_s
        if waits and not self._told_unanswered:
            self._told_unanswered = True
            self.tell(
                "unanswered", "the flight does not answer the recall; if the vehicle must return, use other means"
            )
        return None

    def _connect(self) -> None:
        """Try once to reconnect."""
        try:
            self._follower = FlightFollower(self._to, patience_s=self._patience.again_s)
        except (ConnectionError, FileNotFoundError, TimeoutError, BlockingIOError) as error:
            if isinstance(error, ConnectionError) and error.errno is None:
                raise
            return
        self._heard_s = time.monotonic()
        self._told_silence = False
        self._names, self._replaced = None, 0
        self._flight = self._follower.flight
        self._greet()
        if self._unanswered is not None:
            self._recall(under_policy=self._unanswered)

    def _greet(self) -> None:
        self.tell("following", f"{self._recalled().name}, flight {self._flight.hex()}")

    def _recalled(self, *, under_policy: bool = False) -> Recalled:
        return Recalled(self._flying, b"" if under_policy else self._flight)

    def _lose(self) -> bool:
        assert self._follower is not None
        self._follower.close()
        self._follower = None
        self._lost_s = time.monotonic()
        self.tell("lost", "the flight closed the connection, and did not say that it is over: it is tried again")
        return False

    def _hear(self, follower: FlightFollower) -> bool:
        """Print what the flight sent; return whether the flight has ended."""
        lines = follower.receive()
        if lines is None:
            return self._lose()
        self._heard_s = time.monotonic()
        self._told_silence = False
        for line in lines:
            if isinstance(line, FlightReply):
                self._answered(line)
                continue
            record = read(line)
            if isinstance(record, Flaw):
                self._meet(line)
            elif isinstance(record, DecisionRecord | Effect):
                names = self._names or Names(None)
                names.follow(record)
                self._replaced += isinstance(record, Effect) and record.event == REPLACED
                self.tell(record.event if isinstance(record, Effect) else record.outcome, names.tell(record))
                if isinstance(record, DecisionRecord) and record.reason == Reason.AWAITING_APPROVAL.value:
                    self._tell_whom(record, names)
            elif isinstance(record, Close):
                self.tell("over", f"the flight has ended: {record.ending}")
                return True
        return False

    def _tell_whom(self, record: DecisionRecord, names: Names) -> None:
        """Print whose approval a step waits for, how long, and the commands to answer, as `run` does."""
        ahead = record.utc_us > time.time_ns() // 1000 + _AHEAD_US
        # an agent's mission flies under the same policy, but its bundle file is unknown here
        answering = Answering(self._bundle if names.whole else "BUNDLE", str(self._to), ahead)
        released_us = record.context.released_us
        whom = asks(
            self._flying.policy, record.clause, record.step, record.at_us, released_us, answering, self._replaced
        )  # fmt: skip
        if whom is None:
            return
        if self._as_json:
            left_s = max(0, -(-(whom.until_us - whom.asked_us) // 1_000_000))
            told = {"event": "waits", "roles": whom.roles, "left_s": left_s, "commands": whom.commands}
            self._output.tell(escaped(json.dumps(told, ensure_ascii=False)))
            return
        beneath = " " * 12
        for line in asked(record.step, names.step(record.step) or "of another mission", whom, columns() - len(beneath)):
            self._output.tell(visible(f"{beneath}{line}"))

    def _answered(self, answer: FlightReply) -> None:
        accepted = answer.slug == "accepted"
        # `recalled`: the first recall took effect, but its answer was lost
        self._code = ExitCode.OK if accepted or answer.slug == "recalled" else ExitCode.REFUSED
        self._unanswered = None
        help = HELP.get(answer.slug)
        text = answer.text if accepted or help is None else f"{answer.text}; {help}"
        self.tell("accepted" if accepted else "refused", text if accepted else f"{text} ({answer.slug})")

    def _meet(self, line: bytes) -> None:
        """Read which mission flies first; it may differ from the bundle's if an agent submitted one."""
        if self._names is not None:
            return
        try:
            told = _read_told(line)
        except (ValueError, RecursionError):
            raise ConnectionError("the program that listens there is not a flight: its reply is malformed") from None
        if told.type != "mission":
            return
        flying = self._flying
        if told.digest == flying.mission_digest.hex():
            keys = flying.policy_key.kid, flying.mission_key.kid
            self._names = Names(Claimed(flying.policy, flying.mission, flying.digest, flying.policy_digest, *keys))
        else:
            self._names = Names(None)
            self.tell("other", "a different mission than the bundle's is flying; type `policy` to recall it")

    def _type(self) -> bool:
        """Execute typed commands; return whether one of them was to quit."""
        assert self._typing is not None
        data = os.read(self._typing, _CHUNK)
        if not data:
            self._typing = None
            self.tell("ready", "end of input; following the flight to its end")
        self._typed += data or (b"\n" if self._typed else b"")
        *lines, self._typed = self._typed.split(b"\n")
        self._typed = self._typed[-_CHUNK:]
        return any(self._leaves(line.decode(errors="replace").strip().lower()) for line in lines)

    def _leaves(self, word: str) -> bool:
        """Execute one command; return whether it was to quit."""
        if word in _QUITS:
            return True
        under_policy = _RECALLS.get(word)
        if under_policy is None:
            near = nearest(word, [*_RECALLS, *_QUITS]) if word else None
            meant = f", did you mean `{near}`?" if near else ""
            self.tell("ready", f"unknown command `{word[:_SHOWN]}`{meant} · {_HELP}" if word else _HELP)
        else:
            self._recall(under_policy=under_policy)
        return False

    def _recall(self, *, under_policy: bool) -> None:
        """Sign and send a recall; it is sent again if the connection is lost before the answer."""
        self._unanswered, self._sent_s, self._told_unanswered = under_policy, time.monotonic(), False
        recalled = self._recalled(under_policy=under_policy)
        if self._follower is None:
            self.tell("kept", f"the recall of {recalled.name} is sent after reconnecting")
            return
        document = recalled.sign(self._key, time.time_ns() // 1000, self._seconds)
        try:
            self._follower.hand_in(document)
        except OSError:
            self._lose()
            return
        if self._follower.unsent:
            self.tell("kept", f"the recall of {recalled.name} is sent as soon as the flight reads")
        else:
            self.tell("sent", f"the recall of {recalled.name}")

    def tell(self, event: str, text: str) -> None:
        """Print one event on a line."""
        line = self._line(event, text)
        for each in [line] if self._as_json else fitted(line):
            self._output.tell(each)

    def _line(self, event: str, text: str) -> str:
        if self._as_json:
            return escaped(json.dumps({"event": event, "text": text}, ensure_ascii=False))
        if text.startswith("·") or event in _OUTCOMES:
            return visible(text)
        return f"{event:<11} {visible(text)}"


_OUTCOMES: Final = frozenset({"allow", "deny", "defer", "fallback"})
