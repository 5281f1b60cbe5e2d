"""The boundary's process and the one in Python, which are asked the same in sequences that chance draws.

The process draws the key of its permits, which nobody reads: a permit of one is compared with that of the other but for
its MAC, and each is shown the one that it sealed. With the link's key what leaves is compared but for its signature,
which is then verified.
"""

import time
from collections import Counter
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

from msgspec.structs import replace

from boundary.mutants import damaged
from boundary.shadow import OWN_KEY, same
from boundary.test_gate import drawn_command, drawn_frame, drawn_report
from reference import worlds
from reference.documents import approval, cancellation, low_mission, recall, replacement
from reference.flat_case import MISSION, POLICY, S, state
from reference.world import MISSION_KEY, ROOT, ROOT_KEY, START, VEHICLE, request_for, sealed
from rtshcua.adapters import boundary_process
from rtshcua.adapters.boundary_process import BoundaryProcess
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.framing import unsigned
from rtshcua.mavlink.signing import EPOCH_US, MINUTE, SignedLink
from rtshcua.mavlink.signing import State as LinkState
from rtshcua.model.flat.mission import Invocation, Mission, OnInadmissible
from rtshcua.model.flat.situation import Now, State
from rtshcua.onboard.enforcement.isolated import Caller
from rtshcua.onboard.enforcement.load import Loaded, Mode, load
from rtshcua.onboard.ports import BoundaryKey, Dispatch
from rtshcua.wire.document import DocumentError
from rtshcua.wire.permit import LINK_VALID_US, SIZE, Permit, seal
from rtshcua.wire.receipt import Receipt
from rtshcua.wire.receipt import decode as read_receipt
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP
from rtshcua.wire.response import Answer, decode
from virtual import case

MAC, EVIDENCE = 32, 32
#: what a session is asked at most before another begins
CALLS = 150
PIN = ROOT_KEY.verification().public
SIGNED_ROOT = ROOT.sign(ROOT_KEY)


def without_mac(answer: bytes) -> bytes:
    """An answer of `enforce`, but for the MAC of a permit in it."""
    said = decode(answer)
    if not isinstance(said, Answer) or not said.permit:
        return answer
    return answer[: -MAC - EVIDENCE] + answer[-EVIDENCE:]


class Together:
    """One session of both, in a folder of its own."""

    def __init__(self, random: Random, folder: Path) -> None:
        self.random, self.counts = random, Counter[str]()
        mission = low_mission() if random.random() < 0.6 else MISSION
        if random.random() < 0.5:
            mission = replace(
                mission, invocations=tuple(replace(each, on_inadmissible=random.choice([*OnInadmissible]))
                                           for each in mission.invocations),
            )  # fmt: skip
        bundle, key = sealed(POLICY, mission), None
        if random.random() < 0.5:
            key = folder / "link.key"
            key.write_bytes(random.randbytes(32))
            key.chmod(0o600)
        self.process = BoundaryProcess(SIGNED_ROOT, PIN, VEHICLE, folder, link_key=key, own_seed=OWN_KEY, paced=True)
        # its link's time is that of its own clock when it began: where one is signed, this goes on from there
        here_us, self.utc_us = time.monotonic_ns() // 1_000, time.time_ns() // 1_000
        self.us = here_us if key else START.monotonic_us
        self.began_us = self.us
        caller = Caller(self.process.call, signs=key is not None)
        given: dict[str, Any] = {
            "root": ROOT, "vehicle": VEHICLE, "now": self.now, "session_key": random.randbytes(32),
            "peer_is_own_simulator": False,
        }  # fmt: skip
        there = load(bundle, mode=Mode.PROCESS, flight=bytes(16), caller=caller, **given)
        assert isinstance(there, Loaded), there
        here = load(bundle, mode=Mode.SOFTWARE, flight=there.in_force.flight, **given)
        assert isinstance(here, Loaded), here
        self.here, self.there, self.caller = here, there, caller
        self.key = None if key is None else key.read_bytes()
        if self.key is not None:
            here.executor.frames.sign_with(SignedLink(self.key, LinkState(0, {}), self.utc_us, here_us))  # type: ignore[union-attr]
            self._hears = SignedLink(self.key, LinkState(0, {}), self.utc_us + 1_000_000, here_us)
            self._vehicle = SignedLink(self.key, LinkState(0, {}), self.utc_us, here_us, link=1)
            self._link = SignedLink(self.key, LinkState(0, {}), self.utc_us, here_us)
            self._seen: list[bytes] = []
        if random.random() < 0.8:
            own = BoundaryKey(case.BOUNDARY_KEY, random.randrange(9), random.randbytes(32))
            here.attestation.begin(own)
            there.attestation.begin(own)
        self.permits: list[tuple[bytes, bytes]] = []
        self.command, self.documents = drawn_command(random, POLICY.projection), list[bytes]()
        self.autopilot = random.choice((3, 12))

    @property
    def now(self) -> Now:
        return replace(START, monotonic_us=self.us, utc_us=START.utc_us + self.us - self.began_us)

    def run(self, calls: int) -> None:
        """So many calls, and the same evidence of all of them. Raises `Differs`."""
        kinds = (
            self.enforce,
            self.dispatch,
            self.stand_in,
            self.tell,
            self.present,
            self.observe,
            self.seal,
            self.state,
        )
        for _ in range(calls):
            self.us += self.random.choice(
                (0, 0, 0, 1_000, 1_000, 50_000, 50_000, 400_000) + (3 * S,) * (self.random.random() < 0.2)
            )
            self.random.choices(kinds, (60, 14, 5, 12, 4, 6, 12, 1))[0]()
        same("the digest", self.here.attestation.digest, self.there.attestation.digest)
        assert not self.caller.lost

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
        before = random.choice((0,) * 9 + (at.monotonic_us - self.began_us, random.randrange(9 * S)))
        request = request_for(
            of, kind, step, link, now=at, state=told(random, steps[min(max(step, 0), len(steps) - 1)]),
            released_us=at.monotonic_us - before,
            remaining_us=random.choice((20_000, 20_000, random.randrange(1 << 40))),
            **({"binding": random.randbytes(32)} if random.random() < 0.03 else {}),
        )  # fmt: skip
        if random.random() < 0.03:
            request = damaged(request, random)
        one, other = self.here.boundary.enforce(request), self.there.boundary.enforce(request)
        same(f"enforce {request.hex()}", without_mac(one), without_mac(other))
        said, theirs = decode(one), decode(other)
        if isinstance(said, Answer) and isinstance(theirs, Answer) and said.permit:
            self.permits.append((said.permit, theirs.permit))
            self.counts["permits"] += 1
            if random.random() < 0.6:
                self.dispatch()
        self.counts[f"requests {said.outcome.name if isinstance(said, Answer) else said}"] += 1

    def permit(self) -> tuple[bytes, bytes]:
        """One that was granted, mostly the last; or one that neither sealed."""
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
        self._sent(
            self.here.executor.dispatch(one, self.us + late), self.there.executor.dispatch(other, self.us + late)
        )

    def stand_in(self) -> None:
        one, other = self.permit()
        kind, link = self.random.choice((FALLBACK_LINK, CONTINGENCY_LINK)), self.random.randrange(5)
        here = self.here.executor.stand_in(one, kind, link, self.us)
        self._sent(here, self.there.executor.stand_in(other, kind, link, self.us))

    def _sent(self, one: Dispatch | Refusal, other: Dispatch | Refusal) -> None:
        same("a dispatch", one, other)
        if isinstance(one, Dispatch):
            self.command = one.command
            for _ in range(self.random.randrange(6)):
                self.observe()
                self.seal()
        self.counts["refused permits" if isinstance(one, Refusal) else "dispatches"] += 1

    def tell(self) -> None:
        """How it goes."""
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

    def observe(self) -> None:
        frame = drawn_report(self.random, self.command, self.autopilot)
        self.counts["reports"] += 1
        if self.key is None:
            for each in (self.here, self.there):
                each.executor.frames.observe(frame, self.us)
            return
        chance = self.random.random()
        if chance < 0.8:
            frame = self._vehicle.sign(frame, self.us)
            self._seen.append(frame)
        elif chance < 0.9 and self._seen:
            frame = self.random.choice(self._seen[-5:])
        elif chance < 0.95:
            old = (self.utc_us - EPOCH_US) // 10 - 2 * MINUTE
            frame = SignedLink(self.key, LinkState(old, {}), EPOCH_US, 0, link=2).sign(frame, 0)
        one = self._link.accept(frame, self.us)
        if one:
            self.here.executor.frames.observe(unsigned(frame), self.us)
        same(f"accept {frame.hex()}", one, self.there.executor.frames.accept(frame, self.us))  # type: ignore[union-attr]
        self.counts["believed"] += one

    def seal(self) -> None:
        frame = drawn_frame(self.random, self.command)
        one, other = (each.executor.frames.seal(frame, self.us) for each in (self.here, self.there))
        if self.key is not None and isinstance(one, bytes) and isinstance(other, bytes):
            assert self._hears.accept(other, self.us), other.hex()
            one, other = unsigned(one), unsigned(other)
        same(f"seal {frame.hex()}", one, other)
        self.counts["refused frames" if isinstance(one, Refusal) else "frames"] += 1

    def state(self) -> None:
        final = self.random.random() < 0.02
        one, other = (each.attestation.statement(final=final) for each in (self.here, self.there))
        same("a statement", one, other)
        self.counts["statements"] += one is not None


def some_other(random: Random, now: Now) -> Now:
    """A time of day, or a moment, that does not go on from the one before."""
    by_us = random.choice((-S, -60 * S, 4 * S, 1 << 40))
    part = random.choice(("monotonic_us", "utc_us", "utc_error_us"))
    return replace(now, **{part: max(getattr(now, part) + by_us, 0)})


def told(random: Random, step: Invocation) -> State:
    """A state that is well, or near some threshold, or in which something is not known."""
    values: dict[int, int | None] = {worlds.flat.HEIGHT: 0} if step.step == 0 else {}
    if step.step == 0:
        values |= {worlds.flat.POSITION_X: 0, worlds.flat.POSITION_Y: 0}
    if random.random() < 0.35:
        slot = random.choice([*worlds.NEAR])
        values[slot] = random.choice((*worlds.NEAR[slot], None))
    return state(values)


def some_document(random: Random, of: Loaded, now: Now, documents: list[bytes]) -> bytes:
    """Something that people or the agent sign, for this flight or nearly, or that was handed over before."""
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
    """What may take a mission's place from a step on: mostly with ids that are new."""
    steps = list(mission.invocations[:kept])
    for _ in range(random.randrange(3)):
        new = {} if random.random() < 0.2 else {"invocation_id": random.randbytes(16)}
        steps.append(replace(random.choice(mission.invocations[1:] or mission.invocations), step=len(steps), **new))
    last = replace(mission.invocations[-1], step=len(steps), invocation_id=random.randbytes(16))
    return replace(mission, issued_at_us=mission.issued_at_us + 1, invocations=(*steps, last))


def ask_both(first: int, requests: int, folder: Path) -> Counter[str]:
    """What both were asked, session after session, and answered alike: so many requests to decide, and all else.

    A session is drawn from its number alone, but for the times of a signed link.
    """
    counts, session = Counter[str](), first
    while decided(counts) < requests:
        with TemporaryDirectory(dir=folder) as place:
            both = Together(Random(session), Path(place))
            try:
                with patch.object(
                    boundary_process, "ANSWER_S", boundary_process.PATIENCE_S
                ):  # nothing flies that waits
                    both.run(CALLS)
            except AssertionError as error:
                error.add_note(f"session {session}")
                raise
            finally:
                both.process.close()
        counts += both.counts
        session += 1
    return counts


def decided(counts: Counter[str]) -> int:
    """How many of them were requests to decide."""
    return sum(many for what, many in counts.items() if what.startswith("requests"))
