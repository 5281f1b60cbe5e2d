"""Assumption 4: protected enforcement path. Octets go in, octets come out, and nobody shares the keys.

Statement. The boundary is reached by calls alone, octets in and octets out. Any octets get an answer, and a call that
is malformed, forged, altered, signed by another key or for another duty has no effect: each other answer is the same as
without it. No answer contains a part of a secret. Every answer of `enforce` ends with the digest of the boundary's own
evidence, which then includes that answer.

Attacker: whoever reaches the calls, the whole runtime included. It interleaves any octets with the calls of a flight:
noise, truncated and extended calls, altered permits and documents, permits under another key, documents by strangers
and by keys of another duty, and requests of an earlier time. It holds no key of the boundary.

Enforced by: `rtshcua/onboard/enforcement/isolated.py`, `rtshcua/onboard/enforcement/load.py`,
`rtshcua/wire/request.py`, `rtshcua/wire/permit.py`, `rtshcua/wire/trust.py`, `rtshcua/wire/boundary_chain.py`,
`boundary/enforcement/calls.c`, `boundary/home/process`, `boundary/home/trustzone_m`, `boundary/home/optee`.

Not covered: in mode `software` the boundary is in the runtime's process, so the assumption holds there against octets
and not against code. Where the calls end, the operating system, the processor or the secure world separates memory:
`tests/attacks/test_boundary_process.py`, `tests/attacks/test_secure_world.py` and
`tests/attacks/test_trusted_application.py` test that by attack and not over random histories. Side channels are not
tested. A true call is not stopped: a runtime that was taken over may end, delay or suppress.

Each history is answered twice, with and without the attacker, by the boundary in C and by the one in Python.
"""

import ctypes
from collections.abc import Callable
from random import Random
from typing import NamedTuple

import pytest
from hypothesis import HealthCheck, given, settings
from msgspec.structs import replace

from boundary import both_boundaries
from boundary.conftest import boundary as boundary
from boundary.mutants import damaged
from boundary.test_gate import long, pack
from reference import flat_case as flat
from reference import worlds
from reference.documents import approval, cancellation, low_mission, recall, replacement
from reference.flat_case import HEIGHT, POSITION_X, POSITION_Y
from reference.world import (
    APPROVAL_KEY,
    MISSION_KEY,
    POLICY_KEY,
    ROOT,
    ROOT_KEY,
    START,
    VEHICLE,
    loaded,
    read_answer,
    sealed,
)
from rtshcua.model.decision import Decision
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement import isolated as calls
from rtshcua.onboard.enforcement.boundary import SoftwareBoundary
from rtshcua.virtual.boundary_in_process import Served
from rtshcua.wire import permit as permits
from rtshcua.wire.boundary_chain import BoundaryChain
from rtshcua.wire.document import DocumentError
from rtshcua.wire.keys import Duty, SigningKey, VerificationKey
from rtshcua.wire.permit import Permit, seal
from rtshcua.wire.receipt import Receipt
from rtshcua.wire.receipt import decode as read_receipt
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP, Request, encode
from rtshcua.wire.response import Status

Call = Callable[[bytes], bytes]
OF = loaded(mission=low_mission())
BUNDLE = sealed(mission=low_mission())
STRANGER = SigningKey.from_seed(b"\x55" * 32, duty=Duty.APPROVAL, development=True)
#: the private keys that may not sign a document that calls for the duty
WRONG = {
    Duty.APPROVAL: (STRANGER, MISSION_KEY, POLICY_KEY, ROOT_KEY),
    Duty.MISSION: (STRANGER, APPROVAL_KEY, POLICY_KEY, ROOT_KEY),
}
EVIDENCE = 32
#: octets of a secret that are looked for in answers
WINDOW = 8


class Side(NamedTuple):
    """A boundary of one implementation, newly begun, and the secrets that it holds."""

    call: Call
    secrets: tuple[bytes, ...]


def in_python(_: object, random: Random) -> Side:
    return Side(Served(ROOT, VEHICLE), ())


def in_c(library: ctypes.CDLL, random: Random) -> Side:
    key, link = random.randbytes(32), random.randbytes(32)
    signed, pin = ROOT.sign(ROOT_KEY), ROOT_KEY.verification().public
    both_boundaries.begin(library, signed, pin, VEHICLE, key, START, link_key=link)
    return Side(both_boundaries.library(library), (key, link, both_boundaries.OWN_KEY, both_boundaries.LOG_KEY))


class Path:
    """The calls of a flight, and those of an attacker among them if there is one. `answers` are those to the flight's
    calls; `broken` lists the violations that show without a comparison.
    """

    def __init__(self, side: Side, flight: Random, attacker: Random | None) -> None:
        self.side, self.of, self.attacker, self.now = side, flight, attacker, START
        self.answers: list[bytes] = []
        self.permits: list[bytes] = []
        self.documents: list[bytes] = []
        self.request = b""
        self.last = START  # the moment of the last request; none is later
        self.step = 0
        self.sent = False
        self.attacks = 0
        self.broken: list[str] = []

    def go(self, acts: int) -> "Path":
        self.put(calls.LOAD, BUNDLE)
        answer = self.call(calls.LOAD, times(self.now), len(BUNDLE).to_bytes(4))
        assert answer[0] == 0, answer
        self.flight = answer[1:17]
        for _ in range(acts):
            for _ in range(0 if self.attacker is None else self.attacker.randrange(3)):
                self.attack(self.attacker or self.of)
            self.act()
        return self

    def call(self, kind: int, *parts: bytes) -> bytes:
        """A call, whose answer must be one."""
        answer = self.side.call(bytes([kind]) + b"".join(parts))
        formed = answer[:1] == b"\0" or (answer[:1] == b"\1" and answer[1:].decode("latin-1").isprintable())
        self.hold(formed, "an answer that is none")
        windows = {secret[at : at + WINDOW] for secret in self.side.secrets for at in range(len(secret) - WINDOW + 1)}
        leaked = any(answer[at : at + WINDOW] in windows for at in range(len(answer) - WINDOW + 1))
        self.hold(not leaked, "a part of a secret in an answer")
        return answer

    def put(self, what: int, octets: bytes) -> None:
        """Transfer a bundle or a document, in one part or two."""
        half = len(octets) // 2
        for at, part in ((0, octets[:half]), (half, octets[half:])):
            self.call(calls.PART, bytes([what]), at.to_bytes(4), part)

    # -------------------------------------------------------------------------------------------- the flight

    def act(self) -> None:
        of = self.of
        match of.randrange(8):
            case 0:
                us = of.choice((1_000, 50_000, flat.S))
                self.now = Now(self.now.monotonic_us + us, self.now.utc_us + us, self.now.utc_error_us)
            case 1:
                self.present(approval(OF, of.choice((2, 2, 1)), APPROVAL_KEY, self.now, flight=self.flight))
            case 2 if self.permits:
                self.dispatch(of.choice(self.permits))
            case 3 if self.permits:
                kind, link = of.choice((FALLBACK_LINK, CONTINGENCY_LINK)), of.randrange(3)
                where = self.now.monotonic_us.to_bytes(8) + bytes([kind, link])
                self.answers.append(self.call(calls.STAND_IN, where, self.permits[-1]))
            case _:
                self.enforce()

    def enforce(self) -> None:
        of, steps = self.of, OF.bundle.mission.invocations
        kind = of.choice((STEP,) * 5 + (FALLBACK_LINK, CONTINGENCY_LINK))
        step = self.step if kind == STEP else max(self.step - 1, 0)
        link = -1 if kind == STEP else of.randrange(3)
        meant = steps[step]
        values = dict(flat.NOMINAL) | ({HEIGHT: 8_000} if step else {HEIGHT: 0, POSITION_X: 0, POSITION_Y: 0})
        if of.random() < 0.3:
            slot = of.choice([*worlds.NEAR])
            values[slot] = of.choice(worlds.NEAR[slot])
        asked = Request(
            kind, -1 if kind == CONTINGENCY_LINK else step, link,
            OF.bundle.policy_digest if kind == CONTINGENCY_LINK else meant.binding, self.now,
            flat.state(values), self.now.monotonic_us, meant.phase, 5_000,
        )  # fmt: skip
        self.request, self.last = encode(asked), self.now
        answer = self.call(calls.ENFORCE, self.request)
        self.answers.append(answer[:-EVIDENCE])
        self.hold(self.call(calls.DIGEST)[1:] == answer[-EVIDENCE:], "an answer that is not in the evidence")
        found = read_answer(OF, self.request, answer[1:])
        if isinstance(found, Decision) and found.permit:
            self.permits.append(found.permit)
            if kind == STEP:
                self.call(calls.ENDED)
                self.dispatch(found.permit)
                self.step = min(self.step + 1, len(steps) - 1)

    def dispatch(self, permit: bytes) -> None:
        answer = self.call(calls.DISPATCH, self.now.monotonic_us.to_bytes(8), permit)
        self.answers.append(answer)
        self.sent = self.sent or answer[0] == 0

    def present(self, document: bytes) -> bytes:
        self.documents.append(document)
        self.put(calls.PRESENT, document)
        answer = self.call(calls.PRESENT, times(self.now), self.step.to_bytes(4), len(document).to_bytes(4))
        self.answers.append(answer[:-EVIDENCE])
        return answer

    # ------------------------------------------------------------------------------------------ the attacker

    def attack(self, of: Random) -> None:
        """A call that must have no effect."""
        self.attacks += 1
        permit = of.choice(self.permits[-3:] or [of.randbytes(56)])
        wrong = [
            flipped(of, permit), of.randbytes(len(permit)), permit[:-1], permit + b"\0",
            seal(Permit(STEP, self.step, -1, 1 + of.randrange(99), 3, 3, 1 << 60), of.randbytes(32)),
        ]  # fmt: skip
        when = self.now.monotonic_us.to_bytes(8)
        match of.randrange(8):
            case 0:
                kind = of.choice([0, *range(25, 256), calls.ENFORCE, calls.DISPATCH, calls.STAND_IN, calls.PREPARE])
                self.refused(kind, of.randbytes(of.choice((0, 1, 7, 8, 40, 300, 3_000))))
            case 1:
                request = self.request or of.randbytes(100)
                cut = of.randrange(len(request))
                self.undecided(of.choice((request[:cut], request + of.randbytes(1 + of.randrange(40)), request[1:])))
            case 2:
                self.refused(of.choice((calls.DISPATCH, calls.WITHDRAW, calls.PREPARE)), when, of.choice(wrong))
            case 3:
                kind, link = of.choice((FALLBACK_LINK, CONTINGENCY_LINK)), of.randrange(4)
                call = of.choice((calls.STAND_IN, calls.AHEAD))
                self.refused(call, when, bytes([kind, link]), of.choice(wrong))
            case 4:
                self.offer(of)
            case 5:
                self.refused(calls.PART, of.choice((b"\0\0\0\0\0", b"\x09\0\0\0\0", b"\x04\xff\xff\0\0")), b"octets")
            case 6:
                self.call(calls.OBSERVE, when, of.randbytes(of.randrange(60)))
                self.refused(calls.SEAL, when, of.choice((pack(long(400, 1, 21196)), of.randbytes(30))))
            case _:
                earlier = replace(self.last, monotonic_us=self.last.monotonic_us - 1 - of.randrange(flat.S))
                meant = OF.bundle.mission.invocations[self.step]
                self.undecided(encode(Request(
                    STEP, self.step, -1, meant.binding, earlier, flat.state({}), earlier.monotonic_us, meant.phase, 0
                )))  # fmt: skip

    def undecided(self, request: bytes) -> None:
        if request == self.request or not self.request:
            return
        answer = self.call(calls.ENFORCE, request)
        found = read_answer(OF, request, answer[1:]) if answer[0] == 0 else None
        self.hold(not isinstance(found, Decision), "a decision on a call that is none")

    def refused(self, kind: int, *parts: bytes) -> None:
        answer = self.call(kind, *parts)
        no = answer[0] == 1 or (kind == calls.ENFORCE and read_answer(OF, b"", answer[1:]) is not None)
        self.hold(no, "a call that is none has a result")

    def offer(self, of: Random) -> None:
        """A document that nobody signed who may."""
        duty = of.choice((Duty.APPROVAL, Duty.MISSION))
        key = SigningKey(duty, True, of.choice(WRONG[duty]).private)
        try:
            if duty is Duty.APPROVAL:
                document = of.choice((approval, recall))(OF, key=key, now=self.now, flight=self.flight)
            elif of.random() < 0.5:
                document = cancellation(OF, key, self.now, flight=self.flight)
            else:
                document = replacement(OF, min(self.step + 1, 2), key=key)
        except DocumentError:
            document = of.randbytes(100)
        if of.random() < 0.5:  # under the name of the key that may
            document = document.replace(key.kid, (APPROVAL_KEY if duty is Duty.APPROVAL else MISSION_KEY).kid)
        if self.documents and of.random() < 0.5:
            document = damaged(of.choice(self.documents), of)
        self.put(calls.PRESENT, document)
        answer = self.call(calls.PRESENT, times(self.now), self.step.to_bytes(4), len(document).to_bytes(4))
        found = read_receipt(answer[1:]) if answer[0] == 0 else None
        accepted = isinstance(found, Receipt) and found.accepted
        self.hold(not accepted or document in self.documents, "a document of somebody who may not sign it")

    def hold(self, truth: bool, what: str) -> None:
        if not truth:
            self.broken.append(what)


def times(now: Now) -> bytes:
    return b"".join(each.to_bytes(8) for each in (now.monotonic_us, now.utc_us, now.utc_error_us))


def flipped(of: Random, octets: bytes) -> bytes:
    at = of.randrange(8 * len(octets))
    return octets[: at // 8] + bytes([octets[at // 8] ^ 1 << at % 8]) + octets[at // 8 + 1 :]


def broken(begin: Callable[..., Side], library: object, of: Random, acts: int = 25) -> list[str]:
    """The violations of one history: it is answered twice, with and without the attacker."""
    keys, flight, attacker = (of.getrandbits(64) for _ in range(3))
    quiet = Path(begin(library, Random(keys)), Random(flight), None).go(acts)
    attacked = Path(begin(library, Random(keys)), Random(flight), Random(attacker)).go(acts)
    effect = [] if quiet.answers == attacked.answers else ["an effect of calls that are none"]
    return [*quiet.broken, *attacked.broken, *effect]


@pytest.mark.claim("A4")
@given(worlds.CHANCES)
def test_no_call_without_key_has_an_effect_in_python(of: Random) -> None:
    assert broken(in_python, None, of) == []


@pytest.mark.claim("A4")
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(of=worlds.CHANCES)
def test_no_call_without_key_has_an_effect_in_c(boundary: ctypes.CDLL, of: Random) -> None:
    assert broken(in_c, boundary, of) == []


@pytest.mark.soak
@pytest.mark.claim("A4")
@settings(max_examples=10_000)
@given(of=worlds.CHANCES)
def test_no_call_without_key_has_an_effect_for_long(boundary: ctypes.CDLL, of: Random) -> None:
    assert broken(in_c, boundary, of, 200) == []


def test_histories_decide_and_dispatch() -> None:
    """Otherwise there would be nothing to break."""
    paths = [Path(in_python(None, Random(0)), Random(seed), Random(seed)).go(25) for seed in range(8)]
    assert sum(each.sent for each in paths) > 4
    assert sum(len(each.permits) for each in paths) > 15
    assert all(each.attacks > 10 for each in paths)


def breaks(what: str, most: int = 60) -> bool:
    """Whether some history violates the assumption in this way, in Python."""
    return any(what in broken(in_python, None, Random(seed)) for seed in range(most))


@pytest.mark.claim("A4", broken="a boundary that checks no MAC of a permit")
def test_search_detects_permits_without_mac(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(permits, "compare_digest", lambda _, __: True)
    assert breaks("a call that is none has a result")


@pytest.mark.claim("A4", broken="a boundary that checks no signature of a document")
def test_search_detects_documents_without_signature(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(VerificationKey, "verify", lambda *_: True)
    assert breaks("a document of somebody who may not sign it")


@pytest.mark.claim("A4", broken="a boundary whose answers are not in its evidence")
def test_search_detects_answers_outside_of_evidence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(BoundaryChain, "repeat", lambda *_: bytes(EVIDENCE))
    assert breaks("an answer that is not in the evidence")


@pytest.mark.claim("A4", broken="a boundary that a malformed request changes")
def test_search_detects_effect_of_malformed_request(monkeypatch: pytest.MonkeyPatch) -> None:
    refuse = SoftwareBoundary._refuse

    def forgetful(self: SoftwareBoundary, status: Status, request: bytes) -> bytes:
        self._session._consumed.clear()
        return refuse(self, status, request)

    monkeypatch.setattr(SoftwareBoundary, "_refuse", forgetful)
    assert breaks("an effect of calls that are none")
