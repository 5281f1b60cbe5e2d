"""Telemetry that is wrong, incomplete or of several vehicles: what a flight's track and signals are then."""

from collections.abc import Iterable
from math import inf, nan
from pathlib import Path

import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as dialect

from reference import flat_case as flat
from rtshcua.app.flights.flight_telemetry import Thinning, read_telemetry
from rtshcua.app.flights.telemetry_prose import doubts, silences
from rtshcua.ground.flight.flown import ClockJump, FlightTelemetry, GeoPlace, TelemetrySilence
from rtshcua.mavlink import tlog
from rtshcua.model.flat.signal import SignalSource

S = 1_000_000
#: the UTC of the log's first record
UTC = 1_790_000_000 * S
OURS = 191
Entry = tuple[float, bytes]


def frame(message: dialect.MAVLink_message, system: int = 1, component: int = 1) -> bytes:
    """A frame of a sender."""
    return bytes(message.pack(dialect.MAVLink(None, system, component)))


def heartbeat(kind: int = 2, autopilot: int = 12) -> dialect.MAVLink_message:
    return dialect.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 4, 3)


def position(above_home: int = 10_000, latitude: int = 473_977_400) -> dialect.MAVLink_message:
    return dialect.MAVLink_global_position_int_message(
        1_000, latitude, 85_455_900, 488_000 + above_home, above_home, 0, 0, 0, 0
    )


def home(latitude: int, longitude: int, above_sea: int) -> dialect.MAVLink_message:
    return dialect.MAVLink_home_position_message(latitude, longitude, above_sea, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0)


def altitude(terrain: float) -> dialect.MAVLink_message:
    return dialect.MAVLink_altitude_message(0, 0, 0, 0, 0, terrain, 0)


def terrain(height: float) -> dialect.MAVLink_message:
    return dialect.MAVLink_terrain_report_message(0, 0, 100, 0, height, 0, 1)


def read(folder: Path, entries: Iterable[Entry], lasted_s: float | None = None) -> FlightTelemetry:
    """The telemetry of frames at times in s since the log's first record."""
    path = folder / "telemetry.tlog"
    path.write_bytes(b"".join(tlog.encode(UTC + round(at * S), each) for at, each in entries))
    return read_telemetry(path, flat.POLICY, UTC, None if lasted_s is None else round(lasted_s * S))


# -------------------------------------------------------------------------------------------------------- values


@pytest.mark.parametrize("value", [nan, inf, -inf, 3e38, -3e38, 3e6])
def test_height_that_is_no_number_or_impossible_is_unknown(value: float, tmp_path: Path) -> None:
    for message in (altitude(value), terrain(value)):
        found = read(tmp_path, [(0, frame(heartbeat())), (1, frame(message)), (1.1, frame(position()))])
        assert [each.above_ground for each in found.track] == [None]


def test_height_above_ground_is_in_mm_and_expires(tmp_path: Path) -> None:
    entries = [(0.0, frame(heartbeat())), (1.0, frame(terrain(7.25)))]
    entries += [(at, frame(position())) for at in (1.5, 3, 3.5, 60)]
    assert [each.above_ground for each in read(tmp_path, entries).track] == [7_250, 7_250, None, None]


def test_altitude_has_the_datum_of_its_source(tmp_path: Path) -> None:
    path = tmp_path / "telemetry.tlog"
    path.write_bytes(b"")
    altitude = next(each for each in flat.POLICY.signals if each.dimension == "altitude")
    for message, field, datum in (
        ("GLOBAL_POSITION_INT", "relative_alt", "home"),
        ("GLOBAL_POSITION_INT", "alt", "sea"),
        ("GPS_RAW_INT", "alt", "sea"),
        ("VFR_HUD", "alt", "sea"),
    ):
        source = SignalSource(message, (field,), 1, 1, ())
        policy = replace(flat.POLICY, signals=(replace(altitude, sources=(source,)),))
        (series,) = read_telemetry(path, policy, UTC).signals
        assert series.datum == datum


def test_frame_within_a_damaged_one_is_not_read_in_its_place(tmp_path: Path) -> None:
    hidden, whole = frame(heartbeat()), frame(position())
    damaged = whole[:1] + bytes([len(hidden)]) + whole[2:10] + hidden + b"\0\0"
    found = read(tmp_path, [(0, hidden), (1, whole), (2, damaged), (3, whole)])
    assert [each.t_us for each in found.track] == [1 * S, 3 * S]
    assert read(tmp_path, [(1, damaged), (2, whole)]).track[0].t_us == 2 * S


# ------------------------------------------------------------------------------------------------------ silences


def test_lost_link_that_never_returns_is_silent_to_the_end(tmp_path: Path) -> None:
    found = read(tmp_path, [(at / 2, frame(heartbeat())) for at in range(38)], lasted_s=60)
    assert found.silences == (TelemetrySilence(18_500_000, 60 * S),)
    assert list(silences(found, 60 * S)) == ["no frame of the autopilot from 18.5 s to the end"]


def test_silence_before_the_first_frame(tmp_path: Path) -> None:
    found = read(tmp_path, [(at, frame(heartbeat())) for at in range(5, 10)], lasted_s=10)
    assert found.silences == (TelemetrySilence(0, 5 * S),)


def test_telemetry_without_a_frame_is_silent_throughout(tmp_path: Path) -> None:
    found = read(tmp_path, [(1, frame(heartbeat(), 51, 68))], lasted_s=10)
    assert (found.reports, found.silences) == (0, (TelemetrySilence(0, 10 * S),))


def test_longest_silences_are_told(tmp_path: Path) -> None:
    found = read(tmp_path, [(3 * at, frame(heartbeat())) for at in range(30)], lasted_s=200)
    told = list(silences(found, 200 * S))
    assert len(told) == 21
    assert told[-2:] == ["no frame of the autopilot from 87.0 s to the end", "and 10 shorter silences"]


# ----------------------------------------------------------------------------------------------- several vehicles

NORTH, SOUTH = 480_000_000, 473_977_400
COMMAND = dialect.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)


def two(*more: Entry) -> list[Entry]:
    """Vehicle 7 in the north, which is heard first, and vehicle 1 in the south; with more frames."""
    entries = [
        (1, frame(position(latitude=NORTH), 7)), (1.1, frame(heartbeat(), 7)), (1.2, frame(heartbeat(), 1)),
        (1.3, frame(position(latitude=SOUTH), 1)), (1.4, frame(position(latitude=NORTH), 7)),
        (1.5, frame(position(latitude=SOUTH), 1)), *more,
    ]  # fmt: skip
    return sorted(entries, key=lambda each: each[0])


def told(found: FlightTelemetry) -> tuple[set[int], tuple[int, ...]]:
    """The latitudes of the track, and the vehicles that it may be of."""
    return {each.latitude for each in found.track}, found.vehicles


def test_vehicle_in_whose_system_we_send_is_told(tmp_path: Path) -> None:
    found = read(tmp_path, two((2, frame(COMMAND, 1, OURS))))
    assert told(found) == ({SOUTH}, ())
    assert (found.reports, len(found.track), list(doubts(found))) == (3, 2, [])


def test_companion_that_only_lives_is_not_the_one_that_commands(tmp_path: Path) -> None:
    lives = frame(heartbeat(18, 8), 7, OURS)
    assert told(read(tmp_path, two((0.5, lives), (2, frame(COMMAND, 1, OURS))))) == ({SOUTH}, ())


def test_damaged_frame_of_a_companion_does_not_choose(tmp_path: Path) -> None:
    whole = frame(COMMAND, 7, OURS)
    damaged = whole[:-1] + bytes([whole[-1] ^ 1])
    assert told(read(tmp_path, two((0.5, damaged), (2, frame(COMMAND, 1, OURS))))) == ({SOUTH}, ())


@pytest.mark.parametrize("more", [(), ((2, frame(COMMAND, 1, OURS)), (3, frame(COMMAND, 7, OURS)))])
def test_vehicles_that_cannot_be_told_apart_are_a_gap(more: tuple[Entry, ...], tmp_path: Path) -> None:
    found = read(tmp_path, two(*more))
    assert told(found) == ({NORTH}, (7, 1))
    assert "system ids `7`, `1`" in next(doubts(found))


def test_component_that_is_no_vehicle_is_none(tmp_path: Path) -> None:
    found = read(tmp_path, [(0, frame(heartbeat(6, 8), 9)), (1, frame(heartbeat())), (2, frame(position()))])
    assert (len(found.track), found.vehicles) == (1, ())


# ----------------------------------------------------------------------------------------------------------- home


def test_home_that_does_not_exist_is_none(tmp_path: Path) -> None:
    assert read(tmp_path, [(0, frame(heartbeat())), (1, frame(home(0, 0, 0)))]).home is None


def climbing(*homes: tuple[float, int], from_s: int) -> list[Entry]:
    """20 s in which the vehicle leaves the ground; and homes at these times and heights."""
    entries: list[Entry] = [(at, frame(position(0 if at < from_s else 20_000))) for at in range(20)]
    entries += [(at, frame(home(1, 1, above_sea))) for at, above_sea in homes]
    return sorted(entries, key=lambda each: each[0])


def test_home_is_the_one_when_the_vehicle_left_the_ground(tmp_path: Path) -> None:
    entries = climbing((1.5, 480_000), (5.5, 488_000), (15.5, 500_000), from_s=10)
    assert read(tmp_path, entries).home == GeoPlace(1, 1, 488_000)


def test_first_home_counts_if_the_vehicle_flew_already(tmp_path: Path) -> None:
    entries = climbing((5.5, 488_000), (15.5, 500_000), from_s=0)
    assert read(tmp_path, entries).home == GeoPlace(1, 1, 488_000)


# ---------------------------------------------------------------------------------------------------------- clock


def stepped(by_s: float) -> list[Entry]:
    """40 s of positions, whose heights count; after 20 s the clock makes a step."""
    return [(at / 4 + (by_s if at >= 80 else 0), frame(position(at))) for at in range(160)]


def test_clock_that_goes_back_does_not_end_the_track(tmp_path: Path) -> None:
    found = read(tmp_path, stepped(-3_600), lasted_s=40)
    assert [each.above_home for each in found.track] == list(range(80))
    assert (found.stray, found.steps) == (80, (ClockJump(19_750_000, 250_000 - 3_600 * S),))
    assert found.silences == (TelemetrySilence(19_750_000, 40 * S),)
    assert list(doubts(found)) == [
        "its clock went back by 3599.8 s after 19.8 s",
        "80 positions of an unknown time, which the log does not have, are left out",
    ]


def test_all_of_a_telemetry_is_read_whose_clock_goes_back(tmp_path: Path) -> None:
    """The time at which a kind of message is read again lies in the future then."""
    path = tmp_path / "telemetry.tlog"
    found = read(tmp_path, stepped(-5), lasted_s=35)
    assert sorted(each.above_home for each in found.track) == list(range(160))
    times = [each.t_us for each in found.track]
    assert times == sorted(times) == [each[0] for each in found.boot_us]
    assert (len(found.steps), found.stray) == (1, 0)
    thinned = read_telemetry(path, flat.POLICY, UTC, 35 * S, Thinning(500_000, 500_000))
    assert len(thinned.track) == 80


def test_clock_that_goes_forward_a_day_leaves_the_flight_its_time(tmp_path: Path) -> None:
    found = read(tmp_path, stepped(86_400), lasted_s=40)
    assert len(found.track) == found.stray == 80
    assert found.track[-1].t_us < 40 * S
    assert [each.by_us for each in found.steps] == [86_400 * S + 250_000]
    assert found.silences == (TelemetrySilence(19_750_000, 40 * S),)


def test_telemetry_that_is_longer_than_its_log_is_whole_without_a_step(tmp_path: Path) -> None:
    found = read(tmp_path, stepped(30), lasted_s=10)
    assert (len(found.track), found.steps, found.stray) == (160, (), 0)


def test_frames_out_of_order_are_no_step(tmp_path: Path) -> None:
    entries = [(at / 4 - at % 2 / 2, frame(position(at))) for at in range(160)]
    found = read(tmp_path, entries, lasted_s=40)
    assert (len(found.track), found.steps, found.silences) == (160, (), ())
