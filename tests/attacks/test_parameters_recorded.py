"""Parameter writes, checked against the log: each needs its record and its listed value, and none happens in flight."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as m

from reference.forgery import edit, read, signed
from reference.kept_frames import Entries, kept
from rtshcua.codec.frames import Codec
from rtshcua.evidence.records import Effect
from rtshcua.ground.audit.audit import Auditor
from rtshcua.ground.audit.frames import OURS, FrameAudit
from rtshcua.ground.audit.preparations import ListedParameters
from rtshcua.mavlink.parameters import bits_of
from rtshcua.onboard.enforcement.preparation import SETTABLE, unsettable
from rtshcua.wire.keys import Duty
from virtual import case
from virtual.flight import Flight
from virtual.rows import rows
from virtual.shipped import shipped, simulated


@cache
def flown(*, attested: bool = True) -> tuple[tuple[bytes, ...], Entries]:
    """A flight with a parameter that was set and restored; `attested`: its boundary signs."""
    bits = bits_of(80.0)
    assert bits is not None
    config = simulated("ardupilot", parameters=(("FENCE_ALT_MAX", 15.0),))
    flight = Flight(shipped("short"), config, settings={"FENCE_ALT_MAX": bits}, attested=attested)
    entries = kept(flight)
    return tuple(flight.fly().lines), entries


def found(lines: Sequence[bytes], entries: Sequence[tuple[int, bytes]]) -> str | None:
    """The slug of what an audit finds."""
    frames = FrameAudit(iter(entries))
    auditor = Auditor(case.KEYS[Duty.ROOT].kid, frames=frames)
    for line in lines:
        auditor.take(line)
    failure = auditor.audit().report.failure
    failure = failure or frames.over()
    return None if failure is None else failure.slug


def writes() -> list[tuple[int, bytes]]:
    """The times and values of parameter writes, except for switches of the fence."""
    return [(at, octets) for at, octets in flown()[1] if octets[7] == 23 and b"FENCE_ALT_MAX" in octets]


def setting(value: float, name: bytes = b"FENCE_ALT_MAX") -> bytes:
    return Codec(1, OURS).pack(m.MAVLink_param_set_message(1, 1, name, value, 9))


def beside(octets: bytes, at_us: int) -> str | None:
    lines, entries = flown()
    return found(lines, sorted([*entries, (at_us, octets)], key=lambda entry: entry[0]))


def moment(event: str, number: int = 0) -> int:
    """The time of an effect's record."""
    times = [int(each["utc_us"]) for each in map(read, flown()[0]) if each.get("event") == event]
    return times[number]


def test_set_parameters_are_recorded_and_restored() -> None:
    lines, entries = flown()
    assert len(writes()) >= 2
    assert found(lines, entries) is None


def test_write_before_its_record_is_detected() -> None:
    assert beside(setting(80.0), moment("preparation") - 1) == "frames/unlisted-parameter"


def test_write_repeated_after_its_end_is_detected() -> None:
    (_, first), *_ = writes()
    for at_us in (moment("prepared") + 1, moment("dispatched") + 1_000_000, moment("preparation", 1) + 1):
        assert beside(first, at_us) == "frames/unlisted-parameter"


def test_write_at_end_of_preparation_is_accepted() -> None:
    (_, first), *_ = writes()
    assert beside(first, moment("prepared")) is None


@rows(("octets"), [setting(81.0), setting(80.0, b"FENCE_RADIUS"), setting(15.0), setting(0.0, b"ARMING_CHECK")])
def test_write_of_unlisted_parameter_is_detected(octets: bytes) -> None:
    assert beside(octets, moment("preparation") + 1) == "frames/unlisted-parameter"


@pytest.mark.parametrize("message", [
    m.MAVLink_heartbeat_message(2, 3, 128, 0, 4, 3), m.MAVLink_extended_sys_state_message(0, 2),
], ids=["armed", "in the air"])  # fmt: skip
def test_write_in_flight_is_detected(message: Any) -> None:
    lines, entries = flown()
    first = entries.index(writes()[0])
    flies = (entries[first][0], Codec(1, 1).pack(message))
    assert found(lines, [*entries[:first], flies, *entries[first:]]) == "frames/parameter-in-flight"


def test_a_log_that_lost_the_record_of_its_writes() -> None:
    lines, entries = flown()
    without = [line for line in lines if read(line).get("event") != "preparation"]
    assert found(signed(without), entries) == "preparation/other-permit"
    without = [line for line in without if read(line).get("event") != "permitted"]
    assert found(signed(without), entries) == "boundary/differs"
    lines, entries = flown(attested=False)
    without = [line for line in lines if read(line).get("event") not in ("preparation", "permitted")]
    assert found(signed(without), entries) == "frames/unlisted-parameter"


def changed(number: int, detail: str) -> str | None:
    """The finding for a preparation record with changed fields."""
    lines = list(flown()[0])
    listed = [at for at, line in enumerate(lines) if read(line).get("event") == "preparation"]
    lines[listed[number]] = edit(lines[listed[number]], detail=detail)
    return found(signed(lines), flown()[1])


@rows(("number", "detail", "slug"), [
    (0, "set FENCE_ALT_MAX from 15 to 80", None),
    (0, "set ARMING_CHECK from 1 to 0", "preparation/parameter"),
    (0, "set FENCE_ENABLE from 1 to 0", "preparation/value"),
    (0, "set FENCE_TYPE from 7 to 3", "preparation/value"),
    (0, "set GF_ACTION from 2 to 4", "preparation/value"),
    (0, "set FENCE_RADIUS from 50 to 1000000", "preparation/value"),
    (0, "set RTL_ALT from 1500 to 0", "preparation/value"),
    (0, "restore RTL_ALT from 1500 to 0", "preparation/other-permit"),
    (0, "set GF_MAX_HOR_DIST from 50 to 1e39", "preparation/malformed"),
    (0, "restore GF_MAX_HOR_DIST from -1e39 to 50", "preparation/malformed"),
    (0, "restore FENCE_RADIUS from 300 to 50", "preparation/other-permit"),
    (0, "set FENCE_RADIUS", "preparation/malformed"),
    (0, "set FENCE_RADIUS from a to b", "preparation/malformed"),
    (0, "set FENCE_RADIUS from nan to 1", "preparation/malformed"),
    (0, "set ", "preparation/malformed"),
    (0, "", "preparation/malformed"),
    (1, "restore FENCE_ALT_MAX from 80 to 16", "preparation/other-value"),
    (1, "restore FENCE_ALT_MAX from 80 to 15, FENCE_TYPE from 7 to 7", "preparation/other-permit"),
])  # fmt: skip
def test_inconsistent_parameter_record_is_rejected(number: int, detail: str, slug: str | None) -> None:
    assert changed(number, detail) == slug


@rows("name", sorted(SETTABLE))
def test_the_audit_and_the_gate_accept_the_same(name: str) -> None:
    accepted = SETTABLE[name]
    around = {float(each) for each in (*accepted[:2], *accepted[-2:])}
    for value in sorted(around | {each + by for each in around for by in (-1, 0.5, 1)}):
        bits = bits_of(value)
        assert bits is not None
        record = Effect(
            prev="", at_us=0, detail=f"set {name} from 1 to {value:.9g}", durability=3, event="preparation", kind=-1,
            link=-1, seq=1, step=-1, token=-1, type="effect", utc_error_us=0, utc_us=0,
        )  # fmt: skip
        flaw = ListedParameters().check(record)
        assert (flaw is None) == (unsettable(name, bits) is None), value


def test_preparation_recorded_during_a_command_is_refused() -> None:
    lines = [line for line in flown(attested=False)[0] if read(line).get("event") != "permitted"]
    first = next(at for at, line in enumerate(lines) if read(line).get("event") == "preparation")
    sent = next(at for at, line in enumerate(lines) if read(line).get("event") == "dispatched")
    moved = lines.pop(first)
    fits = {name: read(lines[sent - 1])[name] for name in ("at_us", "utc_us", "utc_error_us")}
    lines.insert(sent, edit(moved, **fits))
    assert found(signed(lines), ()) == "preparation/in-flight"
