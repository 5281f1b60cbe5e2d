"""Evidence before effect, checked against the raw frames: the telemetry shows commands that the log's signers
removed.

The attacker holds all keys of the log: a truncated log is signed anew, and so is the digest of the telemetry.
"""

from collections.abc import Callable
from functools import cache

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from reference.flat_case import S
from reference.forgery import ROOT_KEY, read, signed
from reference.kept_frames import Entries, kept
from rtshcua.codec.frames import Codec
from rtshcua.evidence.finding import Finding
from rtshcua.ground.audit.audit import Auditor
from rtshcua.ground.audit.frame_meaning import FrameNature, nature, read_frame
from rtshcua.ground.audit.frames import OURS, FrameAudit
from virtual import case
from virtual.flight import Flight
from virtual.rows import rows

NAN = float("nan")


@cache
def flown(kind: str) -> tuple[tuple[bytes, ...], tuple[tuple[int, bytes], ...]]:
    """A short flight: its lines, and its frames."""
    flight = Flight(case.seal(case.mission(case.short_steps())), case.simulated(kind), attested=False)
    entries = kept(flight)
    return tuple(flight.fly().lines), tuple(entries)


@cache
def told(kind: str) -> tuple[tuple[bytes, ...], tuple[tuple[int, bytes], ...]]:
    """The same flight without redundant frames of the vehicle."""
    lines, entries = flown(kind)
    return lines, (*entries[:400], *(entry for entry in entries[400:] if from_us(entry[1])))


def from_us(octets: bytes) -> bool:
    frame = read_frame(octets)
    return frame is not None and frame.component == OURS


def judged(lines: list[bytes] | tuple[bytes, ...], entries: Entries) -> Finding | None:
    frames = FrameAudit(iter(entries))
    auditor = Auditor(ROOT_KEY, frames=frames)
    for line in lines:
        auditor.take(line)
    assert auditor.audit().report.failure is None, auditor.audit().report.failure
    return frames.over()


def moment(lines: tuple[bytes, ...], event: str, step: int) -> int:
    """The time of an event of a step, UTC us."""
    found = [read(line) for line in lines]
    return next(each["utc_us"] for each in found if each.get("event") == event and each["step"] == step)


def ours(message: object, system: int = 1, component: int = OURS) -> bytes:
    return Codec(system, component).pack(message)


def command(number: int, *parameters: float) -> bytes:
    filled = [*parameters, *[0.0] * (7 - len(parameters))]
    return ours(mavlink.MAVLink_command_long_message(1, 1, number, 0, *filled))


def beside(kind: str, frame: bytes, when: Callable[[tuple[bytes, ...]], int]) -> str | None:
    """The slug of the finding for a frame inserted into a flight."""
    lines, entries = told(kind)
    added = sorted([*entries, (when(lines), frame)], key=lambda entry: entry[0])
    found = judged(lines, added)
    return None if found is None else found.slug


def before_takeoff(lines: tuple[bytes, ...]) -> int:
    return moment(lines, "dispatched", 0) - S


def on_the_way(lines: tuple[bytes, ...]) -> int:
    return moment(lines, "dispatched", 1) + S


def at_the_end(lines: tuple[bytes, ...]) -> int:
    return int(read(lines[-1])["utc_us"]) + S


COMMANDS = {
    "arm": command(400, 1),
    "arm by force": command(400, 1, 21_196),
    "disarm": command(400, 0),
    "land": command(176, 1, 4, 6),
    "return": command(176, 1, 4, 5),
    "take off": command(22, 0, 0, 0, NAN, NAN, NAN, 900),
    "a mode of its own": command(176, 1, 2, 0),
    "terminate the flight": command(185, 1),
    "elsewhere": ours(
        mavlink.MAVLink_command_int_message(1, 1, 0, 192, 0, 0, -1, 1, 0, NAN, 473_990_000, 85_460_000, 503)
    ),
    "by hand": ours(mavlink.MAVLink_manual_control_message(1, 0, 0, 900, 0, 0)),
    "attitude": ours(mavlink.MAVLink_set_attitude_target_message(0, 1, 1, 0, [1, 0, 0, 0], 0, 0, 0, 1)),
    "a mission": ours(mavlink.MAVLink_mission_count_message(1, 1, 4, 0)),
    "go there now": ours(
        mavlink.MAVLink_mission_item_int_message(1, 1, 0, 3, 16, 2, 1, 0, 0, 0, 0, 473_990_000, 85_460_000, 30, 1)
    ),
    "a fence in flight": ours(mavlink.MAVLink_mission_clear_all_message(1, 1, 1)),
}
SETTINGS = {
    "a parameter": ours(mavlink.MAVLink_param_set_message(1, 1, b"WPNAV_SPEED", 2_000, 9)),
    "no fence": ours(mavlink.MAVLink_param_set_message(1, 1, b"FENCE_ENABLE", 0, 9)),
    "fewer kinds of fence": ours(mavlink.MAVLink_param_set_message(1, 1, b"FENCE_TYPE", 4, 9)),
    "no kind of fence": ours(mavlink.MAVLink_param_set_message(1, 1, b"FENCE_TYPE", NAN, 9)),
}
FENCE_ON = ours(mavlink.MAVLink_param_set_message(1, 1, b"FENCE_ENABLE", 1, 9))
BEFORE = [name for name in COMMANDS if "in flight" not in name]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_recorded_frames_match_sent_frames(kind: str) -> None:
    lines, entries = flown(kind)
    assert judged(lines, list(entries)) is None


@rows("kind", ["px4", "ardupilot"])
@rows("name", BEFORE)
def test_command_before_first_permit_is_detected(kind: str, name: str) -> None:
    frame = COMMANDS[name]
    assert beside(kind, frame, before_takeoff) in ("frames/unrecorded", "frames/early")
    assert beside(kind, frame, at_the_end) == "frames/unrecorded"


@rows("kind", ["px4", "ardupilot"])
@rows("name", COMMANDS)
def test_command_other_than_permitted_is_detected(kind: str, name: str) -> None:
    later = name == "return" and kind == "px4"  # which the last step permits, but not yet
    assert beside(kind, COMMANDS[name], on_the_way) == ("frames/early" if later else "frames/other-command")


@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_command_before_its_record_is_detected(kind: str) -> None:
    lines, kept_entries = told(kind)
    at_us = moment(lines, "dispatched", 0)
    sent_us = next(at for at, frame in kept_entries if at >= at_us and is_command(frame))  # once the mode was reported
    moved = [(at_us - 1, frame) if at == sent_us and is_command(frame) else (at, frame) for at, frame in kept_entries]
    for entries in (moved, sorted(moved, key=lambda entry: entry[0])):
        found = judged(lines, entries)
        assert found is not None
        assert found.slug == "frames/early"
        assert read(lines[found.record])["event"] == "dispatched"


def is_command(octets: bytes) -> bool:
    frame = read_frame(octets)
    return frame is not None and frame.component == OURS and nature(frame) is FrameNature.COMMAND


@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
@pytest.mark.parametrize("what", ["the whole last step", "its dispatch alone"])
def test_command_without_dispatch_record_is_detected(kind: str, what: str) -> None:
    lines, entries = flown(kind)
    last = [
        number
        for number, line in enumerate(lines)
        if read(line).get("step") == 2 and (what != "its dispatch alone" or read(line).get("event") == "dispatched")
    ]
    assert last
    found = judged(signed([line for number, line in enumerate(lines) if number not in last]), list(entries))
    assert found is not None
    assert found.slug == "frames/unrecorded"


@rows(
    "frame",
    [
        ours(mavlink.MAVLink_command_long_message(1, 1, 176, 0, 1, 4, 6, 0, 0, 0, 0), component=190),
        ours(mavlink.MAVLink_command_long_message(1, 1, 176, 0, 1, 4, 6, 0, 0, 0, 0), system=255),
        ours(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 0, 3)),
        command(511, 33, 100_000),
        command(401),
        ours(mavlink.MAVLink_statustext_message(6, b"hello")),
        b"",
        b"\xfd\xff\x00",
        b"\xfe" + bytes(20),
    ],
)
def test_foreign_and_harmless_frames_are_ignored(frame: bytes) -> None:
    for when in (before_takeoff, on_the_way, at_the_end):
        assert beside("px4", frame, when) is None


def test_a_fence_may_be_handed_over_before_the_flight_begins() -> None:
    assert beside("ardupilot", COMMANDS["a fence in flight"], before_takeoff) is None


def test_all_systems_count_as_ours_before_first_heartbeat() -> None:
    lines, entries = flown("px4")
    found = judged(lines, [(entries[0][0] - 1, COMMANDS["land"]), *entries])
    assert found is not None
    assert found.slug == "frames/unrecorded"


@rows("kind", ["px4", "ardupilot"])
@rows("late", [False, True])
@rows("autopilot", [3, 12])
def test_heartbeat_of_another_system_hides_nothing(kind: str, late: bool, autopilot: int) -> None:
    """Anybody on the link can send one: our frames are still compared with the log."""
    lines, entries = told(kind)
    heartbeat = Codec(77, 1).pack(mavlink.MAVLink_heartbeat_message(2, autopilot, 0, 0, 0, 3))
    home = Codec(77, 1).pack(mavlink.MAVLink_global_position_int_message(1, 473_990_000, 85_460_000, 9, 8, 0, 0, 0, 0))
    at_us = on_the_way(lines) - S if late else entries[0][0] - 1
    others = [(at_us, heartbeat), (at_us, home)]
    honest = sorted([*entries, *others], key=lambda entry: entry[0])
    assert judged(lines, honest) is None
    forged = (on_the_way(lines), COMMANDS["disarm"])
    found = judged(lines, sorted([*honest, forged], key=lambda entry: entry[0]))
    assert found is not None
    assert found.slug == "frames/other-command"
    elsewhere = (on_the_way(lines), ours(mavlink.MAVLink_command_long_message(77, 1, 400, 0, *[0] * 7), system=77))
    found = judged(lines, sorted([*honest, elsewhere], key=lambda entry: entry[0]))
    assert found is not None, "the system that was heard first may be the one that we flew"


@rows("kind", ["px4", "ardupilot"])
@rows("name", SETTINGS)
def test_unlisted_parameter_write_is_detected(kind: str, name: str) -> None:
    for when in (before_takeoff, on_the_way, at_the_end):
        unheard = "kinds" in name and kind == "px4" and when is before_takeoff  # it has no such parameter to lose from
        assert beside(kind, SETTINGS[name], when) == (None if unheard else "frames/unlisted-parameter")


@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_a_fence_is_switched_on_before_the_flight_alone(kind: str) -> None:
    assert beside(kind, FENCE_ON, before_takeoff) is None
    assert beside(kind, FENCE_ON, on_the_way) == "frames/unlisted-parameter"


def test_preflight_frames_pass_until_first_command() -> None:
    """The clock of a simulated vehicle stood still between the two."""

    def at(after_us: int) -> Callable[[tuple[bytes, ...]], int]:
        return lambda lines: moment(lines, "dispatched", 0) + after_us

    for frame, late in ((FENCE_ON, "unlisted-parameter"), (COMMANDS["a fence in flight"], "other-command")):
        assert beside("ardupilot", frame, at(0)) is None
        assert beside("ardupilot", frame, at(1)) == f"frames/{late}"
