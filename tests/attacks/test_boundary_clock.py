"""Threat: a compromised runtime claims another time of day, or another monotonic time, to fly expired missions, use
expired keys, or reach other permitted hours. It has the boundary's socket and can delay frames, but it does not
have the link's key.

Outcomes: nothing is decided at a time that disagrees with the boundary's own clock; if the boundary does not know
the time, no claim is accepted and steps are deferred; delayed frames do not set the time; the times in a log are
compared with the boundary's statements.
"""

import time
from base64 import b64decode, b64encode
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as m

from reference.attested_flight import attested
from reference.forgery import edit, expect, read, signed
from rtshcua.adapters.boundary.process import BoundaryProcess, program
from rtshcua.codec.frames import Codec
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.signing import SignedLink
from rtshcua.mavlink.signing import SigningState as LinkState
from rtshcua.model.decision import Decision
from rtshcua.model.flat.situation import UTC_UNKNOWN_US, Now, State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.enforcement.isolated import OBSERVE, Caller, OwnTime
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load
from rtshcua.onboard.ports import BoundaryKey
from rtshcua.wire.approval import ApprovalDocument, sign_approval
from rtshcua.wire.clock import APART_US, ClockSource
from rtshcua.wire.keys import Duty
from rtshcua.wire.receipt import Receipt, decode
from rtshcua.wire.request import STEP, Request, encode
from rtshcua.wire.response import Status
from rtshcua.wire.response import decode as read_response
from rtshcua.wire.statement import open_statement, sign
from virtual import case
from virtual.shipped import shipped

pytestmark = pytest.mark.skipif(program() is None, reason="the boundary's program was not built")

VEHICLE = "quad-07"
HOUR_US, S_US = 3_600_000_000, 1_000_000
KEY = bytes(range(32))
PIN = case.KEYS[next(iter(case.KEYS))].kid
KEYS = {case.BOUNDARY_KEY.kid: case.BOUNDARY_KEY.verification(vehicles=("*",))}
#: the vehicle's system, and its autopilot
AUTOPILOT = Codec(1, 1)
LINES = attested()
STATEMENTS = [number for number, line in enumerate(LINES) if read(line).get("event") == "boundary"]


def machine(error_us: int = 1_000) -> Now:
    return Now(time.monotonic_ns() // 1_000, time.time_ns() // 1_000, error_us)


class Held:
    """A boundary's process with its own clock, and a client in the runtime's place."""

    def __init__(
        self, state: Path, *, issued_us: int | None = None, expires_us: int | None = None, **more: Any
    ) -> None:
        self.issued_us = issued_us or machine().utc_us - 60 * S_US
        life_us = case.YEAR_US if expires_us is None else expires_us - self.issued_us
        self.root, signed_root = case.root(self.issued_us, life_us=life_us)
        own = case.BOUNDARY_KEY.private.private_bytes_raw()
        self.process = BoundaryProcess(signed_root, PIN, VEHICLE, state, own_seed=own, **more)
        self.caller = Caller(self.process.call, signs=self.process.link_name is not None)
        self.bundle = shipped("short", self.issued_us)

    def load(self, now: Now | None = None) -> Loaded | Refusal:
        made = load(
            self.bundle, root=self.root, vehicle=VEHICLE, now=now or machine(), mode=EnforcementMode.PROCESS,
            session_key=bytes(32), flight=bytes(16), peer_is_own_simulator=False, caller=self.caller,
        )  # fmt: skip
        if isinstance(made, Loaded):
            self.loaded = made
        return made

    def own(self, *, settle: bool = False) -> OwnTime:
        said = self.caller.time(settle=settle)
        assert isinstance(said, OwnTime)
        return said

    def ask(self, at: Now) -> Decision | Status | Refusal:
        policy, invocation = self.loaded.bundle.policy, self.loaded.bundle.mission.invocations[0]
        state = State((None,) * policy.slots, (0,) * policy.slots, (4,) * len(policy.monitors))
        released = min(self.loaded.in_force.received_us(0), at.monotonic_us)
        request = encode(Request(STEP, 0, -1, invocation.binding, at, state, released, 0, 0))
        return read_response(self.loaded.boundary.enforce(request), policy, invocation.contract)

    def show(self, at: Now) -> str:
        flying = self.loaded.in_force
        step = flying.bundle.mission.invocations[0]
        said = ApprovalDocument(
            flying.flight, flying.bundle.mission_digest, step.invocation_id, step.binding, VEHICLE, "supervisor", 1,
            at.utc_us, at.utc_us + 60 * S_US,
        )  # fmt: skip
        receipt = decode(self.loaded.boundary.present(sign_approval(said, case.KEYS[Duty.APPROVAL]), at, 0))
        assert isinstance(receipt, Receipt)
        return receipt.slug


@pytest.fixture
def held(tmp_path: Path) -> Iterator[Held]:
    made = Held(tmp_path, utc_error_us=1_000)
    made.own(settle=True)
    assert isinstance(made.load(), Loaded)
    yield made
    made.process.close()


# ---------------------------------------------------------------------------------- a clock that is known


@pytest.mark.parametrize("by_us", [3 * S_US, -3 * S_US, 5 * HOUR_US, -5 * HOUR_US])
@pytest.mark.parametrize("which", ["monotonic", "utc", "both"])
def test_step_with_foreign_time_is_not_decided(held: Held, which: str, by_us: int) -> None:
    here = machine()
    at = replace(
        here,
        monotonic_us=max(0, here.monotonic_us + (by_us if which != "utc" else 0)),
        utc_us=here.utc_us + (by_us if which != "monotonic" else 0),
    )
    assert held.ask(at) is (Status.CLOCK_APART if which == "utc" else Status.MALFORMED)
    assert isinstance(held.ask(machine()), Decision), "and it goes on with the true one"


@pytest.mark.parametrize("by_us", [5 * HOUR_US, -5 * HOUR_US])
def test_wrong_clock_error_is_refused(held: Held, by_us: int) -> None:
    """A sufficiently large error makes every condition on the time of day unknown."""
    here = machine()
    assert held.ask(replace(here, utc_us=here.utc_us + by_us, utc_error_us=abs(by_us) - APART_US - S_US)) is (
        Status.CLOCK_APART
    )
    wide = held.ask(replace(here, utc_us=here.utc_us + by_us, utc_error_us=abs(by_us) + S_US))
    assert isinstance(wide, Decision)
    assert (wide.outcome, wide.reason) == (Outcome.DEFER, Reason.CLOCK_UNCERTAIN)


def test_expired_bundle_is_refused_despite_claimed_time(tmp_path: Path) -> None:
    """Five hours after its issue, it is refused by the true time, and not decided at any other."""
    held = Held(tmp_path, issued_us=machine().utc_us - 5 * HOUR_US, utc_error_us=1_000)
    held.own(settle=True)
    early = replace(machine(), utc_us=held.issued_us + 60 * S_US)
    assert isinstance(held.load(early), Loaded)
    assert held.ask(replace(machine(), utc_us=held.issued_us + 61 * S_US)) is Status.CLOCK_APART
    answer = held.ask(machine())
    assert isinstance(answer, Decision)
    assert (answer.outcome, answer.reason) == (Outcome.DENY, Reason.EXPIRED)
    held.process.close()


@pytest.mark.parametrize("by_us", [3 * S_US, -3 * S_US, HOUR_US, -HOUR_US])
def test_approval_is_judged_by_boundary_time(held: Held, by_us: int) -> None:
    here = machine()
    assert held.show(replace(here, utc_us=here.utc_us + by_us)) == "clock-apart"
    assert held.show(machine()) != "clock-apart"


def test_expired_keys_are_refused_despite_claimed_time(tmp_path: Path) -> None:
    held = Held(tmp_path, utc_error_us=1_000, expires_us=machine().utc_us + 2 * S_US)
    held.own(settle=True)
    while machine().utc_us < held.root.expires_at_us:
        time.sleep(0.05)
    refused = held.load(replace(machine(), utc_us=held.root.expires_at_us - S_US))
    assert isinstance(refused, Refusal)
    assert refused.slug == "root-expired"
    held.process.close()


# ---------------------------------------------------------------------------------- none that is known


def test_claimed_time_is_refused_without_boundary_time(tmp_path: Path) -> None:
    held = Held(tmp_path)
    if held.own().source is not ClockSource.UNKNOWN:
        pytest.skip("this machine's clock is synchronised")
    assert held.own(settle=True).source is ClockSource.UNKNOWN, "nobody stated how far it is off"
    assert isinstance(held.load(), Loaded)
    assert held.ask(machine()) is Status.CLOCK_UNKNOWN
    assert held.show(machine()) == "clock-unknown"
    assert held.ask(replace(machine(UTC_UNKNOWN_US), utc_us=UTC_UNKNOWN_US + 1)) is Status.CLOCK_UNKNOWN
    answer = held.ask(machine(UTC_UNKNOWN_US))
    assert isinstance(answer, Decision)
    assert (answer.outcome, answer.reason) == (Outcome.DEFER, Reason.CLOCK_UNCERTAIN)
    held.process.close()


class Keyed(Held):
    """A boundary whose link has a key, and a vehicle at the other end."""

    def __init__(self, state: Path, **more: Any) -> None:
        key = state / "link.key"
        key.write_bytes(KEY)
        key.chmod(0o600)
        super().__init__(state, link_key=key, **more)
        at_us = machine().monotonic_us
        self.vehicle = SignedLink(KEY, LinkState(0, {}), machine().utc_us, at_us, link=1)
        if self.own().source is not ClockSource.UNKNOWN:
            pytest.skip("this machine's clock is synchronised")

    def said(self, message: Any, codec: Codec = AUTOPILOT) -> bytes:
        """A frame as sent by the vehicle."""
        return self.vehicle.sign(codec.pack(message), machine().monotonic_us)

    def hear(self, *frames: bytes) -> None:
        for frame in frames:
            answer = self.caller(OBSERVE, machine().monotonic_us.to_bytes(8), frame)
            assert answer == b"\0", "it comes from the vehicle"

    def answers(self) -> bytes:
        """The vehicle's answer to the boundary's number."""
        number = self.own().number
        assert number > 0
        return self.said(m.MAVLink_timesync_message(5_000_000_000, number))

    def tells(self, utc_us: int, codec: Codec = AUTOPILOT) -> bytes:
        return self.said(m.MAVLink_system_time_message(utc_us, 5_000), codec)


@pytest.fixture
def keyed(tmp_path: Path) -> Iterator[Keyed]:
    made = Keyed(tmp_path)
    assert isinstance(made.load(), Loaded)
    yield made
    made.process.close()


def test_boundary_time_comes_from_verified_frames(keyed: Keyed) -> None:
    utc_us = machine().utc_us + 20 * S_US
    keyed.hear(keyed.answers(), keyed.tells(utc_us))
    own = keyed.own()
    assert own.source is ClockSource.VEHICLE
    assert abs(own.now.utc_us - utc_us) < 5 * S_US
    assert keyed.own().number == 0
    assert keyed.ask(machine()) is Status.CLOCK_APART
    here = keyed.own().now
    assert isinstance(keyed.ask(here), Decision)
    keyed.hear(keyed.tells(utc_us + HOUR_US))
    assert keyed.own().now.utc_us < utc_us + S_US * 60, "once it was taken, nothing moves any more"


@pytest.mark.parametrize(("autopilot", "least_us"), [(None, 6_000_000), (12, 6_000_000), (3, 1_000_000)])
def test_clock_error_is_autopilot_tolerance(keyed: Keyed, autopilot: int | None, least_us: int) -> None:
    """According to its verified HEARTBEAT; the larger error if none was received."""
    if autopilot is not None:
        keyed.hear(keyed.said(m.MAVLink_heartbeat_message(2, autopilot, 0, 0, 4, 3)))
    keyed.hear(keyed.answers(), keyed.tells(machine().utc_us))
    assert least_us < keyed.own().now.utc_error_us < least_us + 5 * S_US


def test_delayed_frames_do_not_set_time(keyed: Keyed) -> None:
    """The frame with the past time was signed before the boundary drew its number, or answers another number."""
    past = keyed.tells(machine().utc_us - 5 * HOUR_US)
    keyed.hear(past, keyed.answers())
    assert keyed.own().source is ClockSource.UNKNOWN
    late = keyed.tells(machine().utc_us)
    keyed.hear(late)
    assert keyed.own().source is ClockSource.VEHICLE


def test_timesync_answer_to_another_boundary_is_ignored(keyed: Keyed, tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.mkdir()
    before = Keyed(other)
    held_back = keyed.said(m.MAVLink_timesync_message(1, before.own().number))
    before.process.close()
    assert keyed.own().number > 0
    keyed.hear(held_back, keyed.tells(machine().utc_us - 5 * HOUR_US))
    assert keyed.own().source is ClockSource.UNKNOWN


def test_time_of_other_component_or_unsigned_frame_is_ignored(keyed: Keyed) -> None:
    keyed.hear(keyed.answers())
    bare = AUTOPILOT.pack(m.MAVLink_system_time_message(machine().utc_us, 5))
    assert keyed.caller(OBSERVE, machine().monotonic_us.to_bytes(8), bare) != b"\0"
    keyed.hear(keyed.tells(machine().utc_us, Codec(1, 154)), keyed.tells(5 * S_US))
    assert keyed.own().source is ClockSource.UNKNOWN, "and one that knows no UTC does not either"


def test_keys_are_checked_again_once_time_is_known(tmp_path: Path) -> None:
    """The bundle was opened while the time was unknown; by the vehicle's time its root has expired."""
    keyed = Keyed(tmp_path, expires_us=machine().utc_us + HOUR_US)
    assert isinstance(keyed.load(), Loaded)
    keyed.hear(keyed.answers(), keyed.tells(machine().utc_us + 2 * HOUR_US))
    assert keyed.own().source is ClockSource.VEHICLE
    assert keyed.ask(keyed.own().now) is Status.NOT_CURRENT
    keyed.process.close()


# ---------------------------------------------------------------------------------- what it signs, and the audit


def test_statement_contains_boundary_time(held: Held) -> None:
    """The statement has the boundary's time, whatever time the runtime sends."""
    held.loaded.attestation.begin(BoundaryKey(case.BOUNDARY_KEY, 1, bytes(32)))
    data = held.loaded.attestation.statement(Now(1, 1, 0))
    assert data is not None
    said = open_statement(data, KEYS)
    assert said.source == ClockSource.OPERATOR
    assert abs(said.utc_us - machine().utc_us) < APART_US
    assert abs(said.at_us - machine().monotonic_us) < APART_US


def of_own_clock(number: int, source: ClockSource, ahead_us: int, error_us: int = 1_000) -> bytes:
    """The line of a statement by a boundary whose clock differs by this much from the record's claim."""
    record = read(LINES[number])
    said = replace(
        open_statement_of(record["detail"]), source=source, at_us=record["at_us"],
        utc_us=record["utc_us"] + ahead_us, utc_error_us=error_us,
    )  # fmt: skip
    return edit(LINES[number], detail=b64encode(sign(said, case.BOUNDARY_KEY)).decode())


def open_statement_of(detail: str) -> Any:
    return open_statement(b64decode(detail), KEYS)


@pytest.mark.parametrize("ahead_us", [5 * HOUR_US, -5 * HOUR_US, 4 * S_US, -4 * S_US])
def test_log_with_other_time_than_boundary_fails(ahead_us: int) -> None:
    for number in STATEMENTS:
        lines = signed([*LINES[:number], of_own_clock(number, ClockSource.KERNEL, ahead_us), *LINES[number + 1 :]])
        slug, record = expect(lines)
        assert slug == "boundary/clock"
        assert record <= number


def test_log_with_time_unknown_to_boundary_fails() -> None:
    number = STATEMENTS[1]
    line = of_own_clock(number, ClockSource.UNKNOWN, 0, UTC_UNKNOWN_US)
    assert expect(signed([*LINES[:number], line, *LINES[number + 1 :]]))[0] == "boundary/clock"
