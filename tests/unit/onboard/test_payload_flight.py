"""A whole flight with a camera and a gimbal: its commands to payload are recorded with what became of them, pass the
gate, and the auditor finds each of them permitted, and any other not.
"""

from collections.abc import Sequence
from functools import cache
from typing import Any

import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as m

from reference import payload_case as payload
from reference.forgery import ROOT_KEY, read
from reference.kept_frames import Entries, kept
from rtshcua.codec.frames import Codec
from rtshcua.evidence.finding import Finding
from rtshcua.ground.audit.audit import Auditor
from rtshcua.ground.audit.frames import OURS, FrameAudit
from rtshcua.mavlink.parameters import NAN, nearest_bits
from rtshcua.model.flat.contract import Addressee, Contract, EmissionMoment, EmissionSuccess
from rtshcua.onboard.enforcement.load import EnforcementMode
from rtshcua.onboard.ports import Ending, Interrupted
from virtual import case
from virtual.flight import Flight
from virtual.payload_stand_in import AUTOPILOT, CAMERA, GIMBAL, PayloadStandIn

pytestmark = pytest.mark.slow

START, STOP, POINT, CONTROL = 2_000, 2_001, 1_000, 1_001
EMITS = (
    replace(
        payload.emission(POINT, nearest_bits(-90, 1), NAN, NAN, NAN, to=Addressee.GIMBAL),
        success=EmissionSuccess.ATTITUDE, bound=20_000_000, required=1,
    ),
    replace(
        payload.emission(START, 0, 0, nearest_bits(1, 1), 0, 0, 0, NAN, moment=EmissionMoment.DISTANCE, amount=10_000),
        success=EmissionSuccess.IMAGE,
    ),
    payload.emission(START, 0, nearest_bits(2, 1), 0, 0, 0, 0, NAN),
)  # fmt: skip


def emitting(contract: Contract) -> Contract:
    return replace(contract, emits=EMITS) if contract.name == "goto" else contract


Flown = tuple[tuple[bytes, ...], tuple[tuple[int, bytes], ...], PayloadStandIn, Ending]


@cache
def flown(kind: str, mode: EnforcementMode = EnforcementMode.SOFTWARE, *, stopped: bool = False) -> Flown:
    """A flight of one leg, or one that is stopped on it: its lines, its frames, and its payload."""
    policy = replace(case.policy(), contracts=tuple(map(emitting, case.policy().contracts)))
    steps = [replace(each, contract=emitting(each.contract)) for each in case.short_steps()]
    flight = Flight(case.seal(case.mission(steps), policy), case.simulated(kind), attested=False, mode=mode)
    entries = kept(flight)
    stand_in = PayloadStandIn(flight.vehicle, apart=kind == "px4")

    left = [1] * stopped

    def stop(one: Any) -> Sequence[Any]:
        if not (left and len(stand_in.said(START)) >= 3):
            return []
        left.pop()
        return [Interrupted(one.clock.now().monotonic_us)]

    ended = flight.fly(stop)
    return tuple(ended.lines), tuple(entries), stand_in, ended.ending


def judged(lines: Sequence[bytes], entries: Entries) -> Finding | None:
    frames = FrameAudit(iter(entries))
    auditor = Auditor(ROOT_KEY, frames=frames)
    for line in lines:
        auditor.take(line)
    assert auditor.audit().report.failure is None, auditor.audit().report.failure
    return frames.over()


@pytest.mark.parametrize(
    ("kind", "mode"),
    [("px4", EnforcementMode.SOFTWARE), ("ardupilot", EnforcementMode.SOFTWARE), ("px4", EnforcementMode.PROCESS)],
)
def test_a_flight_records_what_became_of_each_command(kind: str, mode: EnforcementMode) -> None:
    lines, entries, stand_in, ending = flown(kind, mode)
    assert ending is Ending.COMPLETED
    events = [each for each in map(read, lines) if each.get("event", "").startswith("payload.")]
    told = [(each["event"], each["detail"]) for each in events]
    camera, gimbal = (CAMERA, GIMBAL) if kind == "px4" else (AUTOPILOT, AUTOPILOT)
    sent = [detail for event, detail in told if event == "payload.sent"]
    assert sent[0] == f"{CONTROL} to {gimbal}, 1"
    assert f"{POINT} to {gimbal}, 1" in sent
    assert set(sent[-2:]) == {f"{CONTROL} to {gimbal}, 1", f"{STOP} to {camera}, 1"}
    assert len(stand_in.said(START)) >= 4
    assert [event for event, _ in told].count("payload.done") == len(sent)
    assert judged(lines, list(entries)) is None


@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_a_flight_that_falls_back_ends_what_it_began(kind: str) -> None:
    lines, entries, stand_in, ending = flown(kind, stopped=True)
    assert ending is Ending.INTERRUPTED
    assert [numbers[0] for numbers in stand_in.said(CONTROL)][1:] == [-3]
    assert len(stand_in.said(STOP)) == 1
    assert judged(lines, list(entries)) is None


@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_the_auditor_finds_other_commands_to_payload(kind: str) -> None:
    lines, entries, _, _ = flown(kind)
    component = CAMERA if kind == "px4" else AUTOPILOT
    where = next(at for at, (_, octets) in enumerate(entries) if is_start(octets))
    at_us = entries[where][0]

    def with_frame(number: int, *numbers: float, late: bool = False, to: int = component) -> Finding | None:
        filled = [*numbers, *[0.0] * (7 - len(numbers))]
        frame = Codec(1, OURS).pack(m.MAVLink_command_long_message(1, to, number, 0, *filled))
        if late:
            return judged(lines, [*entries, (entries[-1][0] + 1, frame)])
        return judged(lines, [*entries[: where + 1], (at_us, frame), *entries[where + 1 :]])

    nan = float("nan")
    assert with_frame(START, 0, 0, 1, 0, 0, 0, nan) is None, "how often is the gate's matter"
    for found in (
        with_frame(START, 0, 0, 2, 0, 0, 0, nan), with_frame(START, 0, 0, 1), with_frame(START, 0, 0, 1, to=12),
        with_frame(POINT, -91, nan, nan, nan), with_frame(CONTROL, 255, 190, -1, -1), with_frame(183, 9, 1500),
        with_frame(START, 0, 0, 1, 0, 0, 0, nan, late=True),
    ):  # fmt: skip
        assert found is not None
        assert found.slug in ("frames/other-command", "frames/unrecorded")
    assert with_frame(STOP, 0, nan, nan, nan, 0, 0, nan, late=True) is None, "it only ends what was begun"


def is_start(octets: bytes) -> bool:
    found = Codec(0, 0).parse(octets, 0)
    return bool(found) and found[0].name == "COMMAND_LONG" and found[0].message.command == START
