"""Threat: a compromised runtime claims that nothing of a step was sent, to have it admitted and flown again; or a
holder of the log's keys records this, to hide that the step flew twice, or that it was decided twice.

Outcomes: the boundary releases the id of a step only according to the frames that it passed itself. In a log the
claim is contradicted by records that the step was flown, by the frames beside it, and by the boundary's
statements.
"""

import ctypes
import struct
from collections.abc import Callable
from functools import cache
from typing import Any

import pytest
from msgspec.structs import replace

from attacks.test_frames_ahead import Thief, pack
from boundary.conftest import boundary as boundary
from boundary.losing import KEY, Apart
from boundary.test_lost import apart as apart
from boundary.test_lost import config
from reference.forgery import ROOT_KEY, edit, expect, read, signed, sound
from reference.kept_frames import Entries, kept
from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.flavour import Stage
from rtshcua.evidence.reading import read as decoded
from rtshcua.evidence.records import Effect
from rtshcua.ground.audit.audit import Auditor
from rtshcua.ground.audit.frame_meaning import FrameNature, nature, read_frame
from rtshcua.ground.audit.frames import OURS, FrameAudit
from rtshcua.mavlink.modes import Px4Mode
from rtshcua.onboard.enforcement.isolated import AHEAD, WITHDRAW
from rtshcua.onboard.enforcement.load import EnforcementMode
from rtshcua.onboard.ports import Ending
from rtshcua.wire.permit import SIZE
from rtshcua.wire.request import CONTINGENCY_LINK
from virtual.flight import Flight
from virtual.late import bundle, flight, late

Lines = tuple[bytes, ...]


# ---------------------------------------------------------------- the runtime


def withdrawn(thief: Thief, permit: bytes) -> str:
    """The boundary's answer to a claim that nothing was sent under a permit."""
    answer = thief.of._answer(bytes([WITHDRAW]) + struct.pack(">q", thief.of.flight.clock.monotonic_us) + permit)
    return answer[1:].decode() if answer[0] else "unsent"


def test_step_with_sent_frames_is_not_withdrawn(apart: Callable[..., Apart]) -> None:
    thief = Thief(apart("px4", legs=2)).until(1)
    up, leg = thief.permits[:2]
    assert {withdrawn(thief, permit) for permit in (up, leg)} == {"permit/sent"}
    thief.of.flight.loaded.executor.ended()
    assert withdrawn(thief, leg) == "permit/sent", "nor once it ended"


def test_step_with_frames_signed_ahead_is_not_withdrawn(apart: Callable[..., Apart]) -> None:
    """The frames of its links may have been sent, which the boundary does not see."""
    thief = Thief(apart("px4", legs=1))
    while not thief.permits:
        assert thief.of.flight.turn() is None
    (up,) = thief.permits
    thief.signed(up, CONTINGENCY_LINK, 2, pack(messages.set_mode(1, Px4Mode.LAND)))
    assert withdrawn(thief, up) == "permit/sent"


@pytest.mark.parametrize("at_its_frame", [False, True])
def test_late_takeoff_flies_with_frames_signed_ahead(
    boundary: ctypes.CDLL, monkeypatch: pytest.MonkeyPatch, at_its_frame: bool
) -> None:
    """The command or its first frame was late, before any frames were signed ahead."""

    def make() -> Flight:
        return Apart(boundary, monkeypatch, bundle(), config("px4", KEY), KEY).flight

    flown: Any = late(make, at_its_frame=at_its_frame).fly()
    assert flown.ending is Ending.COMPLETED
    assert [each["detail"] for each in flown.effects("refused")] == ["permit/unsent"]
    assert flown.dispatched()[:2] == ["takeoff", "takeoff"]


def test_links_of_step_without_frames_are_signed_when_it_begins(apart: Callable[..., Apart]) -> None:
    of = apart("px4", legs=1)
    thief, signed = Thief(of), list[bytes]()
    answer = of._answer

    def spied(octets: bytes) -> bytes:
        if octets[0] == AHEAD:
            signed.append(octets[11 : 11 + SIZE])
        return answer(octets)

    def stays(*_: object) -> list[Stage]:
        return [Stage(None, None, lambda _: False, frozenset(Px4Mode))]

    of._answer = spied
    of.vehicle.driver._manoeuvres = {"px4.goto": stays}
    while len(thief.permits) < 2:
        of.flight.turn()
    before = signed.count(thief.permits[1])
    for _ in range(3):
        of.flight.turn()
    assert before == 0
    assert signed.count(thief.permits[1]) > 3


# ---------------------------------------------------------------- the log


@cache
def tried_twice(attested: bool) -> tuple[Lines, tuple[tuple[int, bytes], ...]]:
    """A flight whose take-off was late once: its lines, and its frames."""
    entries = list[Entries]()

    def make() -> Flight:
        made = flight(attested=attested)
        entries.append(kept(made))
        return made

    return tuple(late(make).fly().lines), tuple(entries[-1])


def moment(line: bytes) -> dict[str, int]:
    return {name: read(line)[name] for name in ("at_us", "utc_us", "utc_error_us")}


def where(lines: Lines, event: str) -> list[int]:
    return [number for number, line in enumerate(lines) if event in (read(line).get("event"), read(line)["type"])]


@pytest.mark.parametrize("mode", [EnforcementMode.SOFTWARE, EnforcementMode.PROCESS])
def test_log_of_flight_with_late_takeoff_verifies(mode: EnforcementMode) -> None:
    flown: Any = late(lambda: flight(mode=mode)).fly()
    assert flown.ending is Ending.COMPLETED
    assert flown.dispatched() == ["takeoff", "takeoff", "return_home"]
    (failed,) = flown.effects("failed")
    assert failed["detail"].startswith("late: nothing was sent: this computer was too busy")
    sound(flown.lines)


@pytest.mark.parametrize("attested", [False, True])
def test_log_without_repeated_decision_fails(attested: bool) -> None:
    lines, _ = tried_twice(attested)
    (unsent,) = where(lines, "refused")
    again = where(lines, "decision")[1]
    slug, record = expect(signed([*lines[:unsent], *lines[unsent + 1 :]]))
    if attested:
        assert slug == "boundary/differs"
    else:
        assert (slug, record) == ("decision/consumed", again - 1)


@pytest.mark.parametrize("attested", [False, True])
@pytest.mark.parametrize("event", ["obeyed", "succeeded"])
def test_a_step_that_was_flown_is_not_called_unsent(attested: bool, event: str) -> None:
    lines, _ = tried_twice(attested)
    (unsent,) = where(lines, "refused")
    flown = next(number for number in where(lines, event) if read(lines[number])["step"] == 0)
    lie = edit(lines[unsent], **moment(lines[flown]))
    slug, record = expect(signed([*lines[: flown + 1], lie, *lines[flown + 1 :]]))
    assert record == flown + 1
    assert slug in (("boundary/differs", "boundary/invented") if attested else ("dispatch/was-sent",))


def test_running_step_is_not_recorded_as_unsent() -> None:
    lines, _ = tried_twice(False)
    (unsent,), (failed,) = where(lines, "refused"), where(lines, "failed")
    assert expect(signed([*lines[:failed], *lines[failed + 1 :]])) == ("dispatch/was-sent", unsent - 1)
    of_link = {"kind": CONTINGENCY_LINK, "step": -1, "link": 2, "token": 99, "detail": "emergency_land"}
    link = edit(lines[where(lines, "dispatched")[0]], **of_link, **moment(lines[failed]))
    flew = [*lines[:unsent], link, *lines[unsent:]]
    assert expect(signed(flew)) == ("dispatch/was-sent", unsent + 1)


@pytest.mark.parametrize("of", [{"kind": 1, "link": 0}, {"step": 1}, {"kind": CONTINGENCY_LINK, "step": -1, "link": 0}])
def test_no_link_and_no_other_step_is_called_unsent(of: dict[str, int]) -> None:
    lines, _ = tried_twice(False)
    (unsent,) = where(lines, "refused")
    lie = edit(lines[unsent], **of)
    assert expect(signed([*lines[:unsent], lie, *lines[unsent + 1 :]])) == ("dispatch/was-sent", unsent)


def judged(lines: Lines, entries: Entries) -> str | None:
    """What is found in the frames beside a log."""
    frames = FrameAudit(iter(entries))
    auditor = Auditor(ROOT_KEY, frames=frames)
    for line in lines:
        auditor.take(line)
    found = auditor.audit().report.failure or frames.over()
    return None if found is None else found.slug


@pytest.mark.parametrize("attested", [False, True])
def test_sent_frame_contradicts_log_without_dispatch(attested: bool) -> None:
    lines, entries = tried_twice(attested)
    assert judged(lines, list(entries)) is None
    (unsent,), first = where(lines, "refused"), where(lines, "dispatched")[0]
    sent = read(lines[where(lines, "dispatched")[1]])["utc_us"]
    moving = next(octets for at_us, octets in entries if at_us >= sent and is_motion(octets))
    began, over = read(lines[first])["utc_us"], read(lines[unsent])["utc_us"]
    for at_us in (began, began + 1, over - 1):
        beside = sorted([*entries, (at_us, moving)], key=lambda entry: entry[0])
        assert judged(lines, beside) == "frames/was-sent", at_us


def test_frame_at_end_of_step_is_detected() -> None:
    """The frame was allowed at that time; the record that nothing was sent follows it."""
    lines, entries = tried_twice(False)
    (failed,), again = where(lines, "failed"), read(lines[where(lines, "dispatched")[1]])["utc_us"]
    sent = next(octets for at_us, octets in entries if at_us >= again and is_motion(octets))
    ended = read(lines[failed])["utc_us"] - 1_000
    earlier = [*lines[:failed], edit(lines[failed], utc_us=ended), *lines[failed + 1 :]]
    beside = sorted([*entries, (ended, sent)], key=lambda entry: entry[0])
    assert judged(signed(earlier), list(entries)) is None
    assert judged(signed(earlier), beside) == "frames/was-sent"


def test_frame_of_previous_step_is_not_a_flaw() -> None:
    """Two dispatches of one target in one microsecond, of which the first ended then: its frame may be either's."""
    lines, entries = tried_twice(False)
    up, (failed,), (unsent,) = where(lines, "dispatched")[0], where(lines, "failed"), where(lines, "refused")
    frames = FrameAudit(iter(()))
    auditor = Auditor(ROOT_KEY, frames=frames)
    for line in lines:
        auditor.take(line)
    dispatched, ended, withdrawn = (effect(lines[number]) for number in (up, failed, unsent))
    sent = next(octets for at_us, octets in entries if at_us >= dispatched.utc_us and is_motion(octets))
    for first, slug in ((True, None), (False, "frames/was-sent")):
        beside = FrameAudit(
            iter([*(each for each in entries if each[0] < dispatched.utc_us), (dispatched.utc_us, sent)])
        )
        beside.begin(frames._basis)  # type: ignore[arg-type]
        if first:
            beside.happened(replace(dispatched, utc_us=dispatched.utc_us - 1, token=7))
            beside.happened(replace(dispatched, utc_us=dispatched.utc_us, token=7, event="succeeded"))
        for each in (dispatched, ended, withdrawn):
            beside.happened(each)
        found = beside.over()
        assert (found and found.slug) == slug


def effect(line: bytes) -> Effect:
    record = decoded(line)
    assert isinstance(record, Effect)
    return record


def is_motion(octets: bytes) -> bool:
    frame = read_frame(octets)
    return frame is not None and frame.component == OURS and nature(frame) is FrameNature.COMMAND
