"""A flight at a socket that waits for a person when it is told to. The boundary that verifies their answers is real;
what the flight records is made here.
"""

import json
import queue
import threading
import time
from base64 import b64encode
from pathlib import Path
from typing import Any

from reference.low_source import low_source
from rtshcua.adapters.agent_socket import AgentSocket
from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.app.approval_desk import ApprovalDesk, DeskEvent, open_desk
from rtshcua.app.approvals import DeskRequest
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.log_writer import Recorder
from rtshcua.front.cli.app import main
from rtshcua.front.cli.unlock import unlock_person
from rtshcua.model.decision import Decision
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.policy import RuleKind
from rtshcua.model.flat.situation import ConfirmAnswer, Context, Now, State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.enforcement.load import SESSION_KEY_BYTES, EnforcementMode, Loaded, load
from rtshcua.onboard.ports import Presented
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.receipt import Receipt, decode
from rtshcua.wire.request import NOTHING, STEP, Ref
from rtshcua.wire.trust import open_root

#: the index of the step that needs a supervisor
ASKED = 2
PATIENCE_S = 20.0
EFFECTS = {1: "approval", 2: "recall", 3: "replacement", 4: "cancellation"}
_SIGNER = SigningKey.from_seed(bytes(32), duty=Duty.LOG, development=True)


def keys_and_bundles(folder: Path, **sources: str) -> None:
    """Make keys of a supervisor, Ada, and bundles; of the current folder's key store."""
    assert main(["keys", "init"]) == ExitCode.OK
    assert main(["keys", "approver", "ada", "--role", "supervisor"]) == ExitCode.OK
    for name, source in ({"low": low_source()} | sources).items():
        (folder / f"{name}.rts").write_text(source)
        assert main(["compile", f"{name}.rts"]) == ExitCode.OK


class WaitingFlight:
    """A flight of the mission in `bundle`, at the socket `path`. Its log is kept in `log`, if that is given."""

    def __init__(self, path: Path, bundle: Path, log: Path | None = None, flight: bytes = bytes(16)) -> None:
        store = KeyStore(data_folder())
        root = store.root()
        found = load(
            bundle.read_bytes(), root=open_root(root, pinned=store.pin(), now_us=0), vehicle="quad-07", now=_now(),
            mode=EnforcementMode.SOFTWARE, session_key=bytes(SESSION_KEY_BYTES), flight=flight,
            peer_is_own_simulator=True,
        )  # fmt: skip
        assert isinstance(found, Loaded), found
        self.loaded, self.path, self.log = found, path, log
        #: what became of each document
        self.slugs: list[str] = []
        self._recorder = Recorder(lambda data: _SIGNER.sign(data, duty=Duty.LOG), _SIGNER.public, lambda: bytes(32))
        genesis = self._recorder.genesis(
            _now(), bundle=bundle.read_bytes(), root=root, boot=flight, vehicle="quad-07",
            mission=found.bundle.mission.name, mode=found.mode,
        )  # fmt: skip
        if log is not None:
            log.parent.mkdir(parents=True)
            log.write_bytes(genesis)
        self._lines: queue.Queue[bytes] = queue.Queue()
        self.listen()

    def listen(self) -> None:
        """Begin to listen."""
        self._over = threading.Event()
        self._socket = AgentSocket(self.path, self._greeting)
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def hang_up(self) -> None:
        """Close the socket without a word."""
        self._over.set()
        self._thread.join()
        self._socket.close()

    @property
    def step(self) -> Any:
        """The step that needs a supervisor, in the mission in force."""
        return self.loaded.bundle.mission.invocations[ASKED]

    def asks(self, *, within_s: int = 25, granted: int = 0, invocation: Any = None, rule: str | None = None) -> None:
        """The step waits for its supervisor; so many of two agreed before."""
        self.decides(Outcome.DEFER, Reason.AWAITING_APPROVAL, within_s, granted, invocation, rule)

    def decides(
        self, outcome: Outcome, reason: Reason, within_s: int = 25, granted: int = 0, invocation: Any = None,
        rule: str | None = None,
    ) -> None:  # fmt: skip
        """A decision about the step."""
        policy, now = self.loaded.bundle.policy, _now()
        number = next(number for number, each in enumerate(policy.rules) if each.kind == RuleKind.CONFIRM)
        one = self.step if invocation is None else invocation
        released_us = now.monotonic_us + within_s * 1_000_000 - policy.rules[number].within_us
        agreed = (ConfirmAnswer(number, policy.rules[number].approver, 1, 0, 99),) * granted
        context = Context(one.binding, "quad-07", 2, 0, released_us, 1, 0, agreed)
        clause = Clause(policy.rules[number].text if rule is None else rule, 0, 0, 0, ())
        decided = Decision(outcome, reason, 8, clause, None, None, 0)
        ref = Ref(STEP, one.step, -1)
        self.tell(self._recorder.decision(now, ref, one.invocation_id, State((), ()), context, decided))

    def happens(self, event: str, step: int = -1, detail: str = "") -> None:
        """An effect, of a step if one is given."""
        ref = NOTHING if step < 0 else Ref(STEP, step, -1)
        self.tell(self._recorder.effect(_now(), event, ref, detail=detail))

    def ends(self) -> None:
        """The flight closes its log."""
        self.tell(self._recorder.close(_now(), ending="completed", tlog=None))

    def tell(self, line: bytes) -> None:
        """Record a line, and send it."""
        if self.log is not None:
            with self.log.open("ab") as file:
                file.write(line)
        self._lines.put(line)

    def _serve(self) -> None:
        while not self._over.wait(0.002):
            event = self._socket.poll(time.monotonic_ns() // 1000)
            if isinstance(event, Presented):
                self._take(event)
            while not self._lines.empty():
                self._socket.tell(self._lines.get())

    def _take(self, event: Presented) -> None:
        receipt = decode(self.loaded.boundary.present(event.document, _now(), 0))
        assert isinstance(receipt, Receipt), receipt
        self.slugs.append(receipt.slug)
        if receipt.accepted:
            self.happens(EFFECTS[receipt.kind], receipt.step, b64encode(event.document).decode())
        self._socket.answer(event.sender, receipt.slug, receipt.text)

    def _greeting(self) -> bytes:
        bundle = self.loaded.bundle
        hello = {"type": "hello", "format": "rtshcua/agent", "version": 1, "vehicle": "quad-07", "mode": "software"}
        hello["flight"] = self.loaded.in_force.flight.hex()
        mission = {
            "type": "mission", "digest": bundle.mission_digest.hex(), "policy_digest": bundle.policy_digest.hex(),
        }  # fmt: skip
        return json.dumps(hello).encode() + b"\n" + json.dumps(mission).encode() + b"\n"

    def announce(self) -> None:
        """Send the mission in force."""
        self._lines.put(self._greeting().splitlines()[1] + b"\n")


def _now() -> Now:
    return Now(time.monotonic_ns() // 1000, time.time_ns() // 1000, 100_000)


def desk_at(path: Path, bundle: str = "low.bundle", runs: str = "runs", role: str | None = None) -> ApprovalDesk:
    """Ada's desk at a flight."""
    request = DeskRequest(Path(bundle), (), path, Path(runs), role, 300, None)
    found = open_desk(request, lambda store, own: unlock_person(store, None, own))
    assert isinstance(found, ApprovalDesk), found
    return found


class Attended:
    """A desk that is turned in a thread, as the command does; the events so far."""

    def __init__(self, desk: ApprovalDesk) -> None:
        self.desk = desk
        self.events: list[DeskEvent] = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._turn, daemon=True)
        self._thread.start()

    def _turn(self) -> None:
        while not self._over.wait(0.005):
            self.events += self.desk.turn()

    def until(self, event: str, count: int = 1) -> DeskEvent:
        """Wait for an event of this kind, the `count`-th."""
        until_s = time.monotonic() + PATIENCE_S
        while True:
            found = [each for each in self.events if each.event == event]
            if len(found) >= count:
                return found[count - 1]
            assert time.monotonic() < until_s, (event, self.events)
            self._over.wait(0.005)

    def names(self) -> list[str]:
        """The kinds of all events."""
        return [each.event for each in self.events]

    def end(self) -> None:
        """Attend no longer."""
        self._over.set()
        self._thread.join()
        self.desk.close()
