"""The boundary's process and the one in Python get the same random requests, in several starts of the process for one
vehicle with its stored state, and several bundles per start.

The process draws a secret key for its permits, so permits of both are compared without their MACs, and each gets the
permit that it sealed. Python's end of a link with a key starts at the time of the process's, taken from its first
signed frames, so that both sign and store the same.
"""

import json
import os
import signal
import struct
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any, ClassVar
from unittest.mock import patch

from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as m

from boundary import kept as keeping
from boundary.both_boundaries import LOG_KEY, OWN_KEY, same
from boundary.mutants import damaged
from boundary.test_gate import SYSTEM, drawn_command, drawn_frame, drawn_report, pack
from boundary.test_note import begins
from boundary.test_preparation import drawn_bits, fitting
from reference import worlds
from reference.documents import approval, cancellation, low_mission, recall, replacement
from reference.flat_case import MIN, MISSION, POLICY, S, state
from reference.world import MISSION_KEY, ROOT, ROOT_KEY, START, VEHICLE, read_answer, request_for, sealed
from rtshcua.adapters.boundary import process as boundary_process
from rtshcua.adapters.boundary.home import kept_file
from rtshcua.adapters.boundary.process import BoundaryProcess
from rtshcua.adapters.clock import monotonic_ns
from rtshcua.adapters.store.opened_missions import FileReplayStore
from rtshcua.adapters.vehicle import messages
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.framing import unsigned
from rtshcua.mavlink.modes import CopterMode, Px4Mode
from rtshcua.mavlink.signing import EPOCH_US, MOST_AHEAD, UNIT_US, SignedLink, timestamp_in
from rtshcua.mavlink.signing import SigningState as LinkState
from rtshcua.model.decision import Decision
from rtshcua.model.flat.mission import Invocation, Mission, OnInadmissible
from rtshcua.model.flat.situation import Now, State
from rtshcua.onboard.enforcement.ahead import MOST
from rtshcua.onboard.enforcement.executor import SignedAhead
from rtshcua.onboard.enforcement.isolated import (
    AHEAD,
    DISPATCH,
    ENDED,
    ENFORCE,
    LOG,
    PERMIT,
    PREPARE,
    PREPARED,
    SEAL,
    STAND_IN,
    Caller,
)
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load
from rtshcua.onboard.enforcement.preparation import SETTABLE, Owed, PreparationIssuer
from rtshcua.onboard.ports import BoundaryKey, Command, MissionOpening
from rtshcua.wire.boundary_chain import START as BEFORE
from rtshcua.wire.document import DocumentError
from rtshcua.wire.keys import Duty
from rtshcua.wire.permit import LINK_VALID_US, SIZE, Permit, seal
from rtshcua.wire.preparation import ParameterWrite, Preparation
from rtshcua.wire.preparation import encode as encode_preparation
from rtshcua.wire.receipt import Receipt
from rtshcua.wire.receipt import decode as read_receipt
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP
from rtshcua.wire.response import Status
from virtual import case

MAC, EVIDENCE = 32, 32
#: the number of starts of one vehicle's process, and of requests before it ends
STARTS, CALLS = (1, 1, 2, 3, 4), (30, 80, 150, 150)
#: commands that return, land or stop a vehicle, by autopilot
LINK_FRAMES = {
    12: [*(messages.set_mode(SYSTEM, mode) for mode in (Px4Mode.RETURN, Px4Mode.LAND)), messages.stop_here(SYSTEM)],
    3: [messages.set_mode(SYSTEM, mode) for mode in (CopterMode.RTL, CopterMode.LAND, CopterMode.BRAKE)],
}
GREETING = pack(m.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))
LOGS = case.KEYS[Duty.LOG]
#: how many links are signed ahead repeatedly, up to the limit
FLOODS = 1 / 2_000
PIN = ROOT_KEY.verification().public
SIGNED_ROOT = ROOT.sign(ROOT_KEY)


def without_mac(answer: bytes, said: Decision | Status | Refusal) -> bytes:
    """An answer of `enforce`, without the MAC of its permit."""
    if not isinstance(said, Decision) or not said.permit:
        return answer
    return answer[: -MAC - EVIDENCE] + answer[-EVIDENCE:]


class Together:
    """Both boundaries of one vehicle, in a folder of its own. In Python the stores of mode `software` keep what is kept
    of it.
    """

    #: where the boundary in C is
    home: ClassVar[Callable[..., Any]] = BoundaryProcess
    #: the weight of requests to decide, among some 60 of all other calls
    requests: ClassVar[int] = 60

    def __init__(self, random: Random, folder: Path) -> None:
        self.random, self.counts, self._folder = random, Counter[str](), folder
        self._link_keys: list[Path | None] = [None]
        if random.random() < 0.6:
            key = folder / "link.key"
            key.write_bytes(random.randbytes(32))
            key.chmod(0o600)
            self._link_keys = [key, key, key, None]
        self._replay = FileReplayStore(folder / "python", VEHICLE)
        self._kept_link, self._session, self._restarts = LinkState(0, {}), (0, BEFORE), 0
        self._owed: dict[str, Owed] = {}
        self._bundles, self._seen = list[bytes](), list[bytes]()
        self._utc_us = START.utc_us
        self.here: Any = None
        self.there: Any = None

    @property
    def now(self) -> Now:
        return replace(START, monotonic_us=self.us, utc_us=self._utc_us + self.us - self._began_us)

    def run(self) -> None:
        """Start the process several times, each with some calls, on the same stored state. Raises `Differs`."""
        for _ in range(self.random.choice(STARTS)):
            self._begin()
            try:
                for _ in range(self.random.choice(CALLS)):
                    self._call()
                if self.here is not None:
                    same("the digest", self.here.attestation.digest, self.there.attestation.digest)
                assert not self.caller.lost
                self._end()
            finally:
                self.process.close()

    def _call(self) -> None:
        later_us = (0, 0, 0, 1_000, 1_000, 50_000, 50_000, 400_000) + (3 * S,) * (self.random.random() < 0.2)
        self.us += self.random.choice(later_us)
        if self.here is None:
            self.ask_nothing_in_force()
            self.load()
            return
        weights: dict[Callable[[], None], int] = {
            self.enforce: self.requests, self.dispatch: 14, self.stand_in: 5, self.tell: 12, self.present: 4,
            self.observe: 6, self.seal: 12, self.state: 2, self.ahead: 6, self.begin_session: 2, self.sign_log: 1,
            self.load: 1, self.withdraw: 4, self.stand: 1, self.ask_to_set: 2, self.prepare: 2,
            self.set_parameter: 2, self.prepared: 1,
        }  # fmt: skip
        if self._on_ground:
            weights |= {
                self.enforce: 12, self.dispatch: 1, self.stand: 30, self.ask_to_set: 30, self.prepare: 25,
                self.set_parameter: 35, self.prepared: 3, self.begin_session: 5,
            }  # fmt: skip
        self.random.choices([*weights], [*weights.values()])[0]()

    # ------------------------------------------------------------ starts of the process

    def _begin(self) -> None:
        random = self.random
        names = (*SETTABLE, "ARMING_CHECK")
        self.settings = {name: fitting(random, name) for name in random.sample(names, random.randrange(5))}
        if random.random() < 0.2:
            left = random.sample(names, random.randrange(1, 4))
            self._owed = {name: Owed(fitting(random, name), drawn_bits(random)) for name in left}
        key = random.choice(self._link_keys)
        self._attests, self._logs = random.random() < 0.8, random.random() < 0.8
        self.process = type(self).home(
            SIGNED_ROOT, PIN, VEHICLE, self._folder, link_key=key, paced=True,
            own_seed=OWN_KEY if self._attests else None, log_seed=LOG_KEY if self._logs else None,
            settings=listed({name: Owed(0, value) for name, value in self.settings.items()}), owed=listed(self._owed),
        )  # fmt: skip
        self._restarts += 1
        self.caller = Caller(
            self.process.call, signs=key is not None, part=self.process.part, most_ahead=self.process.most_ahead
        )
        self.us, self._link = START.monotonic_us, None
        if key is not None:
            self.us = monotonic_ns() // 10_000 * 10 + 10_000
            self._link = self._synchronous(key.read_bytes())
            self._vehicle = SignedLink(key.read_bytes(), self._link.state, EPOCH_US, self.us, link=1)
            self._stranger = SignedLink(key.read_bytes(), self._link.state, EPOCH_US, self.us, link=2)
        self._began_us = self.us
        self._session_key, self._serial, self._prepared = random.randbytes(32), 1, set[int]()
        self._issuer: PreparationIssuer | None = None
        self.permits, self.preparations = list[tuple[bytes, bytes]](), list[tuple[bytes, bytes]]()
        self.documents = list[bytes]()
        self.command, self.autopilot = drawn_command(random, POLICY.projection), random.choice((3, 12))
        self.counts["starts"] += 1

    def _synchronous(self, key: bytes) -> SignedLink:
        """Python's end of the link, at the time of the process's: that is read off the first frames that it signs, one
        at a time before it began.
        """
        signed = [self.caller(SEAL, at_us.to_bytes(8), GREETING) for at_us in (0, self.us)]
        first, now = [timestamp_in(frame) if isinstance(frame, bytes) else 0 for frame in signed]
        assert first > self._kept_link.timestamp, "what was used is not used again"
        stored, began_us = LinkState(first - 1, self._kept_link.streams), self.us - (now - first + 1) * UNIT_US
        link = SignedLink(key, stored, EPOCH_US, began_us)
        same("the first frames", [link.sign(GREETING, 0), link.sign(GREETING, self.us)], signed)
        return link

    def _end(self) -> None:
        """Let the process end, or kill it; its stored state must equal ours."""
        random = self.random
        killed = random.random() < 0.3
        if killed:
            os.kill(self.process.pid, signal.SIGKILL)
        else:
            self._give_back()
        self.process.close()
        if self._issuer is not None:
            self._owed = dict(self._issuer._owed)
        found = self._kept()
        markers = {each.name: each.read_text() for each in self._replay.folder.iterdir()}
        floor_us, versions = int(markers.pop("floor", "-1")), json.loads(markers.pop("floor-policies", "{}"))
        same("missions", {bytes.fromhex(name): int(text) for name, text in markers.items()}, found.opened)
        same("the floor", floor_us, found.floor_us)
        same("versions", {sha256(name.encode()).digest(): each for name, each in versions.items()}, found.versions)
        same("the session", self._session, found.session)
        same("starts", self._restarts, found.restarts)
        if self._link is None:
            same("the link that was not used", self._kept_link, found.link)
        elif not killed:
            same("the link", self._link.state, found.link)
        self._kept_link = found.link  # after a kill: the last stored state and the reserve
        if random.random() < 0.1:
            self._spoil()
        self._utc_us = self.now.utc_us + random.choice((0, 0, 60 * S, 20 * MIN, 40 * MIN, 180 * MIN, -20 * MIN))
        self.here = self.there = None
        self.counts["killed" if killed else "ended"] += 1

    def _kept(self) -> keeping.Kept:
        """What the boundary in C keeps of the vehicle."""
        return keeping.read(kept_file(self._folder, VEHICLE))

    def _spoil(self) -> None:
        """Damage what does not count of it."""
        keeping.spoil_older(kept_file(self._folder, VEHICLE))

    # ------------------------------------------------------------ bundles, evidence

    def ask_nothing_in_force(self) -> None:
        """Check the answers without a bundle in force."""
        if self.random.random() < 0.3:
            kind = self.random.choice((ENFORCE, DISPATCH, STAND_IN, ENDED, PERMIT, PREPARE, PREPARED, LOG, AHEAD))
            answer = self.caller(kind, self.random.randbytes(self.random.randrange(99)))
            same(f"call {kind}", "not-loaded", slug_of(answer))

    def load(self) -> None:
        """Load a bundle into both, in place of the previous one."""
        bundle, now = self._some_bundle(), self.now
        if self.here is not None and self.here.executor._flight is not None:
            same("load", "flies", slug_of(self.caller.load(bundle, now)))
            self.counts["bundles refused"] += 1
            return
        self._give_back()
        if self.here is not None:
            self._serial = self.here.boundary._issuer._serial
        self.here = self.there = None
        given: dict[str, Any] = {
            "root": ROOT, "vehicle": VEHICLE, "now": now, "session_key": self._session_key,
            "peer_is_own_simulator": False, "settings": self.settings,
        }  # fmt: skip
        flight = self.caller.flight()
        assert isinstance(flight, bytes)
        here = load(bundle, mode=EnforcementMode.SOFTWARE, flight=flight, owed=self._owed, **given)
        refused = here.slug if isinstance(here, Refusal) else self._open(here)
        if refused is not None:
            same("load", refused, slug_of(self.caller.load(bundle, now)))
            self.counts["bundles refused"] += 1
            return
        there = load(bundle, mode=EnforcementMode.PROCESS, flight=bytes(16), caller=self.caller, **given)
        assert isinstance(here, Loaded)
        assert isinstance(there, Loaded), there
        same("the flight", flight, there.in_force.flight)
        same("whether it was opened before", self._reopened, self.caller.reopened)
        self._go_on(here)
        self.there = there
        self._begun, self._log_begun, self._on_ground = False, False, self.random.random() < 0.4
        if self.random.random() < 0.9:
            self.stand()
        if self.random.random() < 0.8:
            self.begin_session()
        self.counts["bundles opened again" if self._reopened else "bundles"] += 1

    def _some_bundle(self) -> bytes:
        """Mostly a new bundle of the mission, sometimes an old one, one of an older policy, or a damaged one."""
        random = self.random
        if self._bundles and random.random() < 0.3:
            return random.choice(self._bundles[-3:])
        mission = low_mission() if random.random() < 0.6 else MISSION
        version = random.choice((POLICY.version,) * 6 + (POLICY.version - 1, POLICY.version + 1))
        issued_us = max(self.now.utc_us - random.choice((60 * S,) * 8 + (9 * MIN, 25 * MIN, 40 * MIN)), 0)
        worst = random.random() < 0.5
        steps = tuple(
            replace(
                each, issued_at_us=issued_us,
                on_inadmissible=random.choice([*OnInadmissible]) if worst else each.on_inadmissible,
            )
            for each in mission.invocations
        )  # fmt: skip
        mission = replace(mission, policy_version=version, issued_at_us=issued_us, invocations=steps)
        bundle = sealed(replace(POLICY, version=version), mission)
        self._bundles.append(bundle)
        return damaged(bundle, random) if random.random() < 0.1 else bundle

    def _open(self, here: Loaded) -> str | None:
        """The expected refusal of a bundle, by the stored state. An opened one may only be landed."""
        policy, self._digest = here.bundle.policy, here.bundle.mission_digest
        self._reopened = (self._replay.folder / self._digest.hex()).exists()
        if self._reopened:
            return None
        earliest_us = self.now.utc_us - self.now.utc_error_us
        opening = self._replay.open_once(self._digest, here.expires_us, earliest_us, policy.name, policy.version)
        return None if opening is MissionOpening.OPENED else str(opening)

    def _go_on(self, here: Loaded) -> None:
        """Continue from the previous bundle: the numbers of permits, the link, and preparations, but no permit."""
        if self._issuer is not None:
            here = replace(here, preparation=self._issuer)
        self.here, self._issuer = here, here.preparation
        self.here.boundary._issuer._serial = self._serial
        self.here.executor._prepared = self._prepared
        self.permits = [(self.random.randbytes(SIZE), other) for _, other in self.permits[-2:]]
        self.standing: tuple[bytes, bytes] | None = None
        if self._link is not None:
            self.here.executor.frames.sign_with(self._link)
        if self._reopened:
            here.in_force.recalled = self.here.executor._commands.called_off = True

    def _give_back(self) -> None:
        """Release a bundle of which nothing was sent."""
        if self.here is not None and not self._reopened and not self.here.executor._used:
            self._replay.give_back(self._digest)

    def begin_session(self) -> None:
        """Begin a session of its own evidence, after the stored one or after a later given one."""
        if self._begun:
            return
        last, digest = self._session
        proposed = self.random.choice((last + 1,) * 6 + (0, 1, last + 3))
        before = digest if self.random.random() < 0.8 else self.random.randbytes(32)
        number = self.there.attestation.begin(BoundaryKey(case.BOUNDARY_KEY, proposed, before))
        if not self._attests:
            same("the session", None, number)
            return
        if last > 0 and last >= proposed - 1:
            proposed, before = last + 1, digest
        same("the session", self.here.attestation.begin(BoundaryKey(case.BOUNDARY_KEY, proposed, before)), number)
        self._begun, self._number = True, proposed
        self._keep_session()
        self.counts["sessions"] += 1

    def _keep_session(self) -> None:
        if self._number:
            self._session = self._number, self.here.attestation.digest

    def state(self) -> None:
        final = self.random.random() < 0.02
        one, other = (each.attestation.statement(START, final=final) for each in (self.here, self.there))
        same("a statement", one, other)
        if final and one is not None:
            self._keep_session()
        self.counts["statements"] += one is not None

    def sign_log(self) -> None:
        """Check that only the first checkpoint of the flight's log is signed, and only once."""
        flight, wrong = self.here.in_force.flight, self.random.random() < 0.4
        text = begins(bytes(a ^ 1 for a in flight) if wrong else flight).encode()
        wanted: bytes | str = "not-its-log" if wrong else LOGS.sign(text, duty=Duty.LOG)
        if not self._logs or self._log_begun:
            wanted = "log-begun" if self._logs else "no-log-key"
        signed = self.caller.sign_log(text)
        same("the log", wanted, signed.slug if isinstance(signed, Refusal) else signed)
        self._log_begun = self._log_begun or isinstance(signed, bytes)
        self.counts["logs"] += isinstance(signed, bytes)

    # ------------------------------------------------------------ decisions and permits

    def enforce(self) -> None:
        random, of = self.random, self.here
        steps = of.bundle.mission.invocations
        session = of.boundary._session  # type: ignore[attr-defined]
        latest = session.current
        onwards = 0.7 if session.consumed(latest) else 0.1
        kind = random.choice((STEP,) * 6 + (FALLBACK_LINK, CONTINGENCY_LINK))
        step = min(latest + (kind == STEP and random.random() < onwards), len(steps) - 1)
        step, link = {STEP: (step, -1), FALLBACK_LINK: (step, random.randrange(-1, 2))}.get(
            kind, (-1, random.randrange(3))
        )
        if random.random() < 0.05:
            kind, step, link = random.randrange(5), random.randrange(-1, len(steps) + 1), random.randrange(-3, 5)
        at = self.now if random.random() < 0.97 else some_other(random, self.now)
        before = random.choice((0,) * 9 + (at.monotonic_us - self._began_us, random.randrange(9 * S)))
        request = request_for(
            of, kind, step, link, now=at, state=told(random, steps[min(max(step, 0), len(steps) - 1)]),
            released_us=at.monotonic_us - before,
            remaining_us=random.choice((20_000, 20_000, random.randrange(1 << 40))),
            **({"binding": random.randbytes(32)} if random.random() < 0.03 else {}),
        )  # fmt: skip
        if random.random() < 0.03:
            request = damaged(request, random)
        one, other = self.here.boundary.enforce(request), self.there.boundary.enforce(request)
        said, theirs = read_answer(self.here, request, one), read_answer(self.here, request, other)
        same(f"enforce {request.hex()}", without_mac(one, said), without_mac(other, theirs))
        if isinstance(said, Decision) and isinstance(theirs, Decision) and said.permit:
            self.permits.append((said.permit, theirs.permit))
            self.counts["permits"] += 1
            if random.random() < 0.6:
                self.dispatch()
        self.counts[f"requests {said.outcome.name if isinstance(said, Decision) else said}"] += 1

    def permit(self) -> tuple[bytes, bytes]:
        """A granted permit, mostly the last; or one that neither sealed."""
        random = self.random
        if not self.permits or random.random() < 0.05:
            made = Permit(random.randrange(3), random.randrange(4), -1, random.randrange(99), 2, 3, self.us + S)
            forged = random.choice((seal(made, random.randbytes(32)), random.randbytes(random.randrange(SIZE + 9))))
            return forged, forged
        one, other = self.permits[-1] if random.random() < 0.7 else random.choice(self.permits)
        if random.random() < 0.05:
            at = random.randrange(SIZE)
            return tuple(each[:at] + bytes([each[at] ^ 1]) + each[at + 1 :] for each in (one, other))  # type: ignore[return-value]
        return one, other

    def dispatch(self) -> None:
        one, other = self.permit()
        late = self.random.choice((0, 0, 0, 2 * LINK_VALID_US))
        sent = self.here.executor.dispatch(one, self.us + late)
        if isinstance(sent, Command) and sent.needs_record:
            self.standing = one, other
        self._sent(sent, self.there.executor.dispatch(other, self.us + late))

    def stand_in(self) -> None:
        one, other = self.permit()
        kind, link = self.random.choice((FALLBACK_LINK, CONTINGENCY_LINK)), self.random.randrange(5)
        here = self.here.executor.stand_in(one, kind, link, self.us)
        self._sent(here, self.there.executor.stand_in(other, kind, link, self.us))

    def withdraw(self) -> None:
        one, other = self.standing if self.standing and self.random.random() < 0.6 else self.permit()
        if len(other) != SIZE:
            return
        here = self.here.executor.withdraw(one, self.us)
        same("a withdrawal", here, self.there.executor.withdraw(other, self.us))
        self.counts[f"withdrawals {here.slug}"] += 1

    def _sent(self, one: Command | Refusal, other: Command | Refusal) -> None:
        same("a dispatch", one, other)
        if isinstance(one, Command):
            self.command, self._on_ground = one, False
            for _ in range(self.random.randrange(6)):
                self.observe()
                self.seal()
            if self.random.random() < 0.4:
                self.ahead()
        self.counts["refused permits" if isinstance(one, Refusal) else "dispatches"] += 1

    def tell(self) -> None:
        """Report the progress of a command."""
        what = self.random.choice(("ended",) * 6 + ("landed", "release"))
        with_token = what == "ended" and self.random.random() < 0.5
        arguments = (self.random.choice((self.command.token, 1)),) if with_token else ()
        for each in (self.here, self.there):
            getattr(each.executor, what)(*arguments)
        self.counts["words"] += 1

    def present(self) -> None:
        document, now = some_document(self.random, self.here, self.now, self.documents), self.now
        if self.random.random() < 0.1:
            now = some_other(self.random, now)
        released = self.random.choice((0, 0, 1, 3))
        receipts = [read_receipt(each.boundary.present(document, now, released)) for each in (self.here, self.there)]
        one, other = receipts
        assert isinstance(one, Receipt)
        assert isinstance(other, Receipt)
        same(f"present {document.hex()}", replace(one, text=other.text), other)
        self.counts["documents accepted" if one.accepted else "documents refused"] += 1

    def ahead(self) -> None:
        """Request frames ahead: for all links of the last sent step in order, or for any."""
        random, executor = self.random, self.here.executor
        one, other = self.standing if self.standing and random.random() < 0.9 else self.permit()
        if len(other) != SIZE:
            return  # the call has no way to say how long a permit is
        step = max(executor._step, 0)
        links = executor._commands.links(step)
        if random.random() < 0.4:
            kind = random.choice((STEP, FALLBACK_LINK, FALLBACK_LINK, CONTINGENCY_LINK, 3))
            links = [(kind, random.randrange(-1, 5))]
        for kind, link in links:
            frames = self._frames_of(kind, step, link)
            signed = self._sign_ahead(one, other, kind, link, frames)
            if signed and frames and self._link is not None and random.random() < FLOODS:
                self._flood(one, other, kind, link, frames[:1])

    def _frames_of(self, kind: int, step: int, link: int) -> list[bytes]:
        random, command = self.random, self.command
        with suppress(LookupError):
            command = self.here.executor._commands.command(kind, step, link, 1)
        chance = random.random()
        known = [pack(message) for message in LINK_FRAMES[self.autopilot]]
        if chance < 0.7:
            gate, frame = self.here.executor.frames, random.choice(known)
            fitting_ones = (each for each in known if gate._refuse_ahead(each, command) is None)
            return [next(fitting_ones, frame) if chance < 0.5 else frame] * random.choice((1, 6, 6, MOST))
        if chance < 0.9:
            return [drawn_frame(random, command) for _ in range(random.choice((1, 1, 2, 4)))]
        return random.sample(known, random.randrange(3))

    def _sign_ahead(self, one: bytes, other: bytes, kind: int, link: int, frames: list[bytes]) -> bool:
        here: SignedAhead | Refusal = self.here.executor.ahead(one, kind, link, frames, self.us)
        same(f"ahead {kind} {link}", here, self.there.executor.ahead(other, kind, link, frames, self.us))
        self.counts[f"ahead {here.slug}" if isinstance(here, Refusal) else "ahead"] += 1
        return isinstance(here, SignedAhead)

    def _flood(self, one: bytes, other: bytes, kind: int, link: int, frames: list[bytes]) -> None:
        """Request more frames ahead than the limit at one moment."""
        for _ in range(MOST_AHEAD // MOST + 1):
            if not self._sign_ahead(one, other, kind, link, frames * MOST):
                break
        self.counts["floods"] += 1

    # ------------------------------------------------------------ preparations

    def stand(self) -> None:
        """Report whether the vehicle is disarmed on the ground; mostly it is."""
        armed, landed = self.random.choice((0, 0, 0, 0, 128)), self.random.choice((1, 1, 1, 1, 2))
        self._hear(pack(m.MAVLink_heartbeat_message(2, self.autopilot, armed, 0, 4, 3), 1))
        self._hear(pack(m.MAVLink_extended_sys_state_message(0, landed), 1))
        here, there = (each.executor.frames.stands(self.us) for each in (self.here, self.there))
        same("stands", here, there)
        self.counts["stands"] += here

    def ask_to_set(self) -> None:
        """Request a permit to set configured parameters or to restore them, or a similar one."""
        random = self.random
        restoring = random.random() < 0.4
        listed = [*((name, each.before) for name, each in self.here.preparation._owed.items())]
        listed = listed if restoring and listed else [*self.settings.items()]
        values = random.sample(listed, random.randrange(len(listed) + 1))
        if random.random() < 0.2:
            values.append((random.choice((*SETTABLE, "ARMING_CHECK")), drawn_bits(random)))
        now = {name: each.value for name, each in self.here.preparation._owed.items()}
        writes = tuple(
            ParameterWrite(name, now[name] if name in now and random.random() < 0.7 else drawn_bits(random), value)
            for name, value in values
        )
        ask = encode_preparation(Preparation(0, restoring, 0, writes))
        if random.random() < 0.1:
            ask = damaged(ask, random)
        one, other = (each.preparation.permit(ask, self.us) for each in (self.here, self.there))
        if isinstance(one, bytes) and isinstance(other, bytes):
            self.preparations.append((one, other))
            one, other = one[:-MAC], other[:-MAC]
        same(f"permit {ask.hex()}", one, other)
        self.counts["refused settings" if isinstance(one, Refusal) else "settings"] += 1

    def prepare(self) -> None:
        """Begin a preparation with a permit, or with an invalid one."""
        random = self.random
        one = other = random.randbytes(random.randrange(140))
        if self.preparations and random.random() < 0.95:
            one, other = self.preparations[-1] if random.random() < 0.7 else random.choice(self.preparations)
        if one and random.random() < 0.07:
            at = random.randrange(len(one) - MAC if len(one) > MAC else len(one))
            one, other = (each[:at] + bytes([each[at] ^ 1]) + each[at + 1 :] for each in (one, other))
        begun = self.here.executor.prepare(one, self.us)
        same("a preparation", begun, self.there.executor.prepare(other, self.us))
        if isinstance(begun, Refusal):
            self.counts["refused preparations"] += 1
            return
        self.counts["restorations" if begun.restoring else "preparations"] += 1
        for name, _, value in begun.writes:
            self.set_parameter(name, value)

    def prepared(self) -> None:
        for each in (self.here, self.there):
            each.executor.prepared()

    def set_parameter(self, name: str | None = None, bits: int | None = None) -> None:
        """Send a frame that sets a parameter: as permitted, as configured, or otherwise."""
        random = self.random
        if name is None or bits is None:
            name, bits = random.choice([*self.settings.items(), (random.choice([*SETTABLE]), drawn_bits(random))])
        (value,) = struct.unpack("<f", struct.pack("<I", bits))
        frame = pack(m.MAVLink_param_set_message(SYSTEM, 1, name.encode(), value, random.choice((9, 9, 9, 6))))
        self.counts["parameters set"] += self._leaves(frame)

    # ------------------------------------------------------------ frames

    def observe(self) -> None:
        self._hear(drawn_report(self.random, self.command, self.autopilot))

    def _hear(self, frame: bytes) -> None:
        self.counts["reports"] += 1
        if self._link is None:
            for each in (self.here, self.there):
                each.executor.frames.observe(frame, self.us)
            return
        chance = self.random.random()
        if chance < 0.8:
            frame = self._vehicle.sign(frame, self.us)
            self._seen.append(frame)
        elif chance < 0.9 and self._seen:
            frame = self.random.choice(self._seen[-5:] + self._seen[:5])
        elif chance < 0.95:
            frame = self._stranger.sign(frame, self.us - self.random.choice((0, 2 * MIN)))
        one = self._link.accept(frame, self.us)
        if one:
            self.here.executor.frames.observe(unsigned(frame), self.us)
        same(f"accept {frame.hex()}", one, self.there.executor.frames.accept(frame, self.us))
        self.counts["believed"] += one

    def seal(self) -> None:
        left = self._leaves(drawn_frame(self.random, self.command))
        self.counts["frames" if left else "refused frames"] += 1

    def _leaves(self, frame: bytes) -> bool:
        one, other = (each.executor.frames.seal(frame, self.us) for each in (self.here, self.there))
        same(f"seal {frame.hex()}", one, other)
        return isinstance(one, bytes)


def listed(parameters: Mapping[str, Owed]) -> bytes:
    """Parameters in the form of the process's start-up input."""
    writes = tuple(ParameterWrite(name, *each) for name, each in parameters.items())
    return encode_preparation(Preparation(0, False, 0, writes))


def slug_of(answer: bytes | Refusal) -> str | None:
    return answer.slug if isinstance(answer, Refusal) else None


def some_other(random: Random, now: Now) -> Now:
    """A time of day, or a moment, that does not continue the previous one."""
    by_us = random.choice((-S, -60 * S, 4 * S, 1 << 40))
    part = random.choice(("monotonic_us", "utc_us", "utc_error_us"))
    return replace(now, **{part: max(getattr(now, part) + by_us, 0)})


def told(random: Random, step: Invocation) -> State:
    """A state that is nominal, near a threshold, or partly unknown."""
    values: dict[int, int | None] = {worlds.flat.HEIGHT: 0} if step.step == 0 else {}
    if step.step == 0:
        values |= {worlds.flat.POSITION_X: 0, worlds.flat.POSITION_Y: 0}
    if random.random() < 0.35:
        slot = random.choice([*worlds.NEAR])
        values[slot] = random.choice((*worlds.NEAR[slot], None))
    return state(values)


def some_document(random: Random, of: Loaded, now: Now, documents: list[bytes]) -> bytes:
    """A document of people or the agent, for this flight or a similar one, or a replay."""
    chance, steps = random.random(), of.bundle.mission.invocations
    if documents and chance < 0.1:
        return random.choice(documents)
    if chance < 0.65:
        asked = min(2, len(steps) - 1) if random.random() < 0.8 else random.randrange(len(steps))
        made = approval(of, asked, now=now, granted=int(random.random() < 0.8))
    elif chance < 0.67:
        made = recall(of, now=now)
    elif chance < 0.69:
        made = cancellation(of, now=now)
    else:
        kept = random.randrange(len(steps))
        other = some_mission(random, of.bundle.mission, kept)
        try:
            made = replacement(of, kept, other, MISSION_KEY)
        except DocumentError:
            made = b""
    documents.append(made)
    return damaged(made, random) if made and random.random() < 0.1 else made


def some_mission(random: Random, mission: Mission, kept: int) -> Mission:
    """A mission that may replace another from a step on, mostly with new ids."""
    steps = list(mission.invocations[:kept])
    for _ in range(random.randrange(3)):
        new = {} if random.random() < 0.2 else {"invocation_id": random.randbytes(16)}
        steps.append(replace(random.choice(mission.invocations[1:] or mission.invocations), step=len(steps), **new))
    last = replace(mission.invocations[-1], step=len(steps), invocation_id=random.randbytes(16))
    return replace(mission, issued_at_us=mission.issued_at_us + 1, invocations=(*steps, last))


def ask_both(first: int, requests: int, folder: Path, make: type[Together] = Together) -> Counter[str]:
    """Compare the answers of both, vehicle after vehicle, until this number of decision requests.

    The sequence of a vehicle depends on its number only, except for the times of a signed link.
    """
    counts, number = Counter[str](), first
    with patch.object(boundary_process, "ANSWER_S", boundary_process.PATIENCE_S):  # a waiting run does not fly
        while decided(counts) < requests:
            with TemporaryDirectory(dir=folder) as place:
                both = make(Random(number), Path(place))
                try:
                    both.run()
                except AssertionError as error:
                    error.add_note(f"vehicle {number}")
                    raise
            counts += both.counts
            number += 1
    return counts


def decided(counts: Counter[str]) -> int:
    """Return the number of decision requests."""
    return sum(many for what, many in counts.items() if what.startswith("requests"))
