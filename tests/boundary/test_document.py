"""Documents for a vehicle in flight: C accepts the same documents as Python, and refuses the others for the same
reason.
"""

import ctypes
from collections import Counter
from dataclasses import replace as with_fields
from pathlib import Path
from random import Random
from typing import Any

import pytest
from msgspec.structs import replace

from boundary.mutants import altered, damaged
from boundary.opening import Boundary, agree_on_bundle, agree_on_root, envelope
from reference.documents import approval, cancellation, low, low_mission, recall, replacement, shorter
from reference.world import (
    APPROVAL_KEY,
    FLIGHT,
    LOG_KEY,
    MISSION_KEY,
    POLICY_KEY,
    ROOT,
    ROOT_KEY,
    START,
    VEHICLE,
    renewed,
    sealed_again,
)
from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.limits import MAX_ANSWERS
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.wire import cose, names
from rtshcua.wire.approval import Approvals, open_approval
from rtshcua.wire.cancellation import open_cancellation
from rtshcua.wire.document import kind_of
from rtshcua.wire.keys import ANY, Duty, SigningKey
from rtshcua.wire.recall import open_recall
from rtshcua.wire.replacement import (
    MAX_REPLACEMENTS,
    VerifiedReplacement,
    fit_replacement,
    open_replacement,
    sign_replacement,
)
from rtshcua.wire.trust import TrustRoot
from rtshcua.wire.untrusted import Untrusted

S, MIN = 1_000_000, 60_000_000
VECTORS = Path(__file__).parents[1] / "vectors" / "artefacts"
FILES = sorted(path.name for path in VECTORS.iterdir())
LOW = low()
SEALED = sealed_again(LOW)
KINDS = (names.APPROVAL, names.RECALL, names.REPLACEMENT, names.CANCELLATION)
VERSIONS = {kind.name.removeprefix("rtshcua/"): kind.version for kind in (*KINDS, names.ROOT, names.POLICY)}
SECOND = SigningKey.from_seed(b"2" * 32, duty=Duty.APPROVAL, development=True)
STRANGER = SigningKey.from_seed(b"s" * 32, duty=Duty.MISSION)
LIMITED = SigningKey.from_seed(b"l" * 32, duty=Duty.MISSION, development=True)
TRUST = replace(
    ROOT,
    keys=(
        *ROOT.keys,
        SECOND.verification(
            roles=("supervisor",), sources=("operator",), vehicles=(ANY,), person="grace", expires_us=START.utc_us + MIN
        ),
        LIMITED.verification(roles=(ANY,), sources=("operator",), vehicles=(VEHICLE,), policies=("another",)),
    ),
)


class Flight:
    """One flight on both sides, with the same documents in the same order."""

    def __init__(self, library: ctypes.CDLL, trust: TrustRoot = TRUST) -> None:
        self._c = library
        library.rt_test_document.restype = ctypes.c_char_p
        boundary, data = Boundary(library), SEALED
        assert isinstance(agree_on_root(boundary, trust.sign(ROOT_KEY), ROOT_KEY.public, START.utc_us), TrustRoot)
        assert agree_on_bundle(boundary, data, trust, VEHICLE, START.utc_us) is None
        self._root, self.bundle = trust, LOW.bundle
        self._digests, self._replaced = [self.bundle.mission_digest], list[Invocation]()
        self._approvals = Approvals(self.bundle.policy)
        self._kept = [boundary, data, VEHICLE.encode(), ctypes.create_string_buffer(FLIGHT, 16)]
        library.rt_test_begin(self._kept[2], len(VEHICLE.encode()), self._kept[3])

    def take(self, document: bytes, now: Now = START, released: int = 0, current: int = 0) -> str:
        """The common result of a document: its refusal slug, or `accepted`."""
        out, moment = (ctypes.c_int64 * 7)(), self._moment(now)
        issued = self.bundle.mission.issued_at_us
        slug = self._c.rt_test_document(
            document, len(document), moment, ctypes.c_int64(issued), ctypes.c_int64(released), current, out
        )
        there = slug.decode() if slug else "accepted"
        try:
            found, here = self._open(document, now, issued, released, current), "accepted"
        except Untrusted as error:
            found, here = None, error.slug
        assert here == there, (here, there, document.hex())
        if isinstance(found, tuple) and not isinstance(found, VerifiedReplacement):
            assert tuple(out)[1:] == found
        if isinstance(found, VerifiedReplacement):
            self._kept.append(document)
            self._replaced += self.bundle.mission.invocations[found.kept :]
            self.bundle = found.over(self.bundle)
            self._digests.append(found.digest)
            self._approvals.keep(self.bundle.mission.invocations)
            self._c.rt_test_replace()
        return here

    def _open(self, document: bytes, now: Now, issued: int, released: int, current: int) -> Any:
        trusted: dict[str, Any] = {"root": self._root, "vehicle": VEHICLE, "flight": FLIGHT, "now": now}
        match kind_of(document):
            case names.RECALL:
                open_recall(
                    document, missions=self._digests, policy=self.bundle.policy_digest, issued_at_us=issued, **trusted
                )
            case names.CANCELLATION:
                open_cancellation(document, missions=self._digests, bundle=self.bundle, current=current, **trusted)
            case names.REPLACEMENT:
                found = open_replacement(document, bundle=self.bundle, **trusted)
                fit_replacement(found, self.bundle, released)
                return found
            case _:
                said = open_approval(
                    document, bundle=self.bundle, missions=self._digests, replaced=self._replaced, **trusted
                )
                self._approvals.add(said, now)
                return (said.about.step, *said[1:])
        return None

    def agree_on_answers(self, now: Now = START) -> int:
        """Check that both pass the same answers to decisions on the steps in force; return their number."""
        total = 0
        for step, invocation in enumerate(self.bundle.mission.invocations):
            out, expected = (ctypes.c_int64 * (5 * MAX_ANSWERS))(), self._approvals.about(invocation, now)
            count = self._c.rt_test_about(step, self._moment(now), out)
            every_rule = -1  # in C one entry stands for all rules that ask its role; in this policy there is one
            assert [tuple(out[5 * n : 5 * n + 5]) for n in range(count)] == [
                (every_rule, each.role, each.granted, each.monotonic_us, each.person) for each in expected
            ]
            total += count
        return total

    def loaded(self) -> Loaded:
        """The mission in force, in the form that the document makers need."""
        of = renewed(LOW)
        of.in_force.bundle = self.bundle
        return of

    @staticmethod
    def _moment(now: Now) -> Any:
        return (ctypes.c_int64 * 3)(now.monotonic_us, now.utc_us, now.utc_error_us)


@pytest.fixture
def flight(boundary: ctypes.CDLL) -> Flight:
    return Flight(boundary)


def some_mission(of: Loaded, random: Random) -> Mission:
    """A mission that may replace the one in force."""
    mission = of.bundle.mission
    mission = shorter(of) if len(mission.invocations) == 4 and random.random() < 0.5 else mission
    steps = mission.invocations
    if random.random() < 0.5 and steps:
        at = random.randrange(len(steps))
        step = steps[at]
        contract, last = step.contract, len(step.contract.fallback) - 1
        changes: list[dict[str, Any]] = [
            {"source": SourceKind.OPERATOR},
            {"role": 0},
            {"role": 9},
            {"phases": step.phases | 1 << 40},
            {"phases": 0},
            {"text": "moved", "start": 5},
            {"start": step.start + 9, "end": step.end + 9, "file": 3},
            {"issued_at_us": step.issued_at_us + 1},
            {"arguments": (*step.arguments[:-1], 3)},
            {
                "contract": replace(
                    contract, require=tuple(replace(each, start=3, source=1) for each in contract.require)
                )
            },
            {"contract": replace(contract, require=tuple(replace(each, text="?") for each in contract.require))},
            {
                "contract": replace(
                    contract, fallback=(*contract.fallback[:last], replace(contract.fallback[last], end=77))
                )
            },
            {
                "contract": replace(
                    contract, fallback=(*contract.fallback[:last], replace(contract.fallback[last], limit_us=77))
                )
            },
            {"contract": replace(contract, energy=contract.energy + 1)},
            {"plan": replace(step.plan, altitude=step.plan.altitude + 1)},
            {"plan": replace(step.plan, heights=(7,))},
            {"plan": replace(step.plan, headings=(7,))},
            {"contract": replace(contract, motion=replace(contract.motion, lowest=0))},
            {"contract": replace(contract, motion=replace(contract.motion, facing=1))},
        ]
        steps = (*steps[:at], replace(step, **random.choice(changes)), *steps[at + 1 :])
    if random.random() < 0.1:
        steps = random.choice((steps[:-1], (), steps * 2))
    fields: list[dict[str, Any]] = [
        {"phases": ("other", *mission.phases[1:])},
        {"phases": (*mission.phases, "more")},
        {"issued_at_us": START.utc_us + random.choice((0, S, START.utc_error_us, START.utc_error_us + 1))},
        {"vehicle": "quad-08"},
        {"policy_version": 99},
    ]
    return replace(mission, invocations=steps, **(random.choice(fields) if random.random() < 0.3 else {}))


def unchecked(mission: Mission, of: Loaded, kept: int, key: SigningKey, flight: bytes) -> bytes:
    """A signed replacement whose kept steps may differ."""
    over = replace_bundle(of, mission) if kept >= 0 else of.bundle
    return sign_replacement(
        mission, over=over, flight=flight, kept=max(0, min(kept, len(mission.invocations))), key=key
    )


def replace_bundle(of: Loaded, mission: Mission) -> Any:
    """The bundle as if that mission were in force, so that `sign_replacement` finds no change."""
    return with_fields(of.bundle, mission=mission)


def some_document(flight: Flight, random: Random) -> bytes:
    """A random document, mostly valid."""
    of = flight.loaded()
    utc, bundle = START.utc_us, of.bundle
    steps = len(bundle.mission.invocations)
    fields: dict[str, Any] = {}
    if random.random() < 0.6:
        options: list[dict[str, Any]] = [
            {"flight": random.choice((b"", bytes(15), b"\1" * 16))},
            {"mission": random.choice((b"", bytes(32), bundle.policy_digest, random.choice(flight._digests)))},
            {
                "issued_at_us": random.choice(
                    (utc - MIN, utc + START.utc_error_us, utc + START.utc_error_us + 1, -(1 << 63), (1 << 63) - 1)
                )
            },
            {
                "expires_at_us": random.choice(
                    (utc, utc + 20_000, utc + 20_001, utc + 60 * MIN, utc + 60 * MIN + 1, -(1 << 63), (1 << 63) - 1)
                )
            },
            {"vehicle": random.choice(("quad-08", "", VEHICLE + "\0"))},
            {"granted": random.choice((0, 0, 2, -1))},
            {"role": random.choice(("operator", "nobody", ""))},
            {"binding": bytes(32)},
            {
                "invocation_id": random.choice(
                    (bytes(16), b"", bundle.mission.invocations[0].invocation_id if steps else b"")
                )
            },
            {"policy": random.choice((bundle.policy_digest, bytes(32))), "mission": b"", "flight": b""},
        ]
        fields = random.choice(options)
    which = random.randrange(9)
    people, proposers = (APPROVAL_KEY,) * 6 + (SECOND,) * 3, (MISSION_KEY,) * 8 + (LIMITED, STRANGER)
    if which < 4 and steps:
        names_of = {
            "flight",
            "mission",
            "invocation_id",
            "binding",
            "vehicle",
            "role",
            "granted",
            "issued_at_us",
            "expires_at_us",
        }
        step = min(2, steps - 1) if random.random() < 0.7 else random.randrange(steps)
        document = approval(of, step, random.choice(people), **{k: v for k, v in fields.items() if k in names_of})
        if random.random() < 0.2 and flight._replaced:
            about = random.choice(flight._replaced)
            document = approval(of, 0, random.choice(people), invocation_id=about.invocation_id, binding=about.binding,
                                granted=random.choice((0, 0, 1)), mission=random.choice(flight._digests))  # fmt: skip
    elif which < 6:
        names_of = {"flight", "mission", "policy", "vehicle", "issued_at_us", "expires_at_us"}
        document = recall(of, random.choice(people), **{k: v for k, v in fields.items() if k in names_of})
    elif which < 7:
        names_of = {"flight", "mission", "issued_at_us", "expires_at_us"}
        document = cancellation(of, random.choice(proposers), **{k: v for k, v in fields.items() if k in names_of})
    else:
        document = unchecked(
            some_mission(of, random),
            of,
            random.randrange(-1, 4),
            random.choice(proposers),
            random.choice((FLIGHT,) * 9 + (b"x",)),
        )
    match random.randrange(12):
        case 0:
            return damaged(document, random)
        case 1 | 2:
            claimed = cose.unverified(document)
            keys = {key.kid: key for key in (APPROVAL_KEY, SECOND, MISSION_KEY, LIMITED, STRANGER)}
            kind = next(kind for kind in KINDS if kind.content_type == claimed.content_type)
            return envelope(
                random.choice((altered, altered, damaged))(claimed.payload, random), keys[claimed.kid], kind, random
            )
        case 3:
            return envelope(
                cose.unverified(document).payload,
                random.choice((ROOT_KEY, LOG_KEY, POLICY_KEY, APPROVAL_KEY)),
                random.choice(KINDS),
                random,
            )
    return document


def compare(library: ctypes.CDLL, seed: int, count: int) -> Counter[str]:
    """Count the documents that both accept or refuse, by reason, over many flights."""
    random, found, flight = Random(seed), Counter[str](), Flight(library)
    for number in range(count):
        if number % 40 == 39:
            found["answers"] += flight.agree_on_answers()
            revoked = (APPROVAL_KEY.kid[::-1], LIMITED.kid[:8])
            trust = random.choice(
                (TRUST, TRUST, replace(TRUST, revoked=revoked), replace(TRUST, expires_at_us=START.utc_us + 5 * S))
            )
            flight = Flight(library, trust)
        now = replace(START, utc_us=START.utc_us + random.choice((0,) * 9 + (-1, MIN, 5 * S, 6 * MIN, 1 << 50)))
        found[flight.take(some_document(flight, random), now, random.choice((0, 0, 1, 3)), random.randrange(5))] += 1
    return found


def test_documents_of_each_kind_take_effect(flight: Flight) -> None:
    of = flight.loaded()
    assert flight.take(approval(of)) == "accepted"
    assert flight.take(approval(of)) == "already-answered"
    assert flight.agree_on_answers() == 1
    assert flight.take(approval(of, key=SECOND)) == "accepted"
    assert flight.take(approval(of, key=SECOND, granted=0)) == "accepted"
    assert flight.agree_on_answers() == 3
    assert flight.agree_on_answers(replace(START, utc_us=START.utc_us + 5 * MIN)) == 1  # a refusal is final
    assert flight.take(recall(of)) == "accepted"
    assert flight.take(recall(of, policy=of.bundle.policy_digest, mission=b"", flight=b"")) == "accepted"
    assert flight.take(cancellation(of)) == "accepted"
    assert flight.take(b"\xd2\x84") == "malformed"
    assert flight.take(bytes(1 << 18)) == "malformed"
    assert flight.take(bytes((1 << 18) + 1)) == "too-large"


@pytest.mark.parametrize("name", FILES)
def test_artefacts_of_each_version_that_there_was(boundary: ctypes.CDLL, name: str) -> None:
    kind, _, version = name.rpartition("-")
    data, current = (VECTORS / name).read_bytes(), int(version) == VERSIONS[kind]
    if kind == "root":
        found = agree_on_root(Boundary(boundary), data, ROOT_KEY.public, START.utc_us)
        assert current is isinstance(found, TrustRoot)
        return
    flight = Flight(boundary, ROOT)
    if kind == "policy":
        opened = Boundary(boundary), ROOT.sign(ROOT_KEY)
        assert isinstance(agree_on_root(*opened, ROOT_KEY.public, START.utc_us), TrustRoot)
        assert agree_on_bundle(opened[0], data, ROOT, VEHICLE, START.utc_us) == (None if current else "unknown-version")
        return
    assert flight.take(data) == ("accepted" if current else "unknown-version")


def test_refusal_outlives_its_step(flight: Flight) -> None:
    of, about = flight.loaded(), flight.bundle.mission.invocations[2]
    assert flight.take(replacement(of)) == "accepted"
    assert flight.take(replacement(of)) == "superseded"
    assert flight.agree_on_answers() == 0
    # the same inspection again, in a mission that replaces the one without it
    again = replace(low_mission(), issued_at_us=START.utc_us - S)
    back = sign_replacement(again, over=flight.bundle, flight=FLIGHT, kept=2, key=MISSION_KEY)
    assert flight.take(back) == "accepted"
    assert flight.take(approval(of, granted=0, invocation_id=about.invocation_id, binding=about.binding)) == "accepted"
    assert flight.agree_on_answers() == 1
    assert (
        flight.take(approval(of, granted=1, invocation_id=about.invocation_id, binding=about.binding))
        == "other-mission"
    )


def test_number_of_replacements_is_limited(flight: Flight) -> None:
    for number in range(MAX_REPLACEMENTS):
        mission = replace(low_mission(), issued_at_us=START.utc_us - S + number)
        document = sign_replacement(mission, over=flight.bundle, flight=FLIGHT, kept=2, key=MISSION_KEY)
        assert flight.take(document) == "accepted"


@pytest.mark.slow
def test_documents_are_refused_alike(boundary: ctypes.CDLL) -> None:
    found = compare(boundary, 9, 600)
    assert {"accepted", "malformed", "other-steps", "not-asked", "other-flight", "other-mission", "wrong-duty",
            "expired", "wrong-vehicle", "already-answered", "unknown-key", "root-expired"} <= found.keys()  # fmt: skip
    assert 60 < found["accepted"] < 400
    assert found["answers"] > 0


@pytest.mark.soak
def test_a_hundred_thousand_documents_are_refused_alike(boundary: ctypes.CDLL) -> None:
    assert compare(boundary, 10, 100_000).total() >= 100_000
