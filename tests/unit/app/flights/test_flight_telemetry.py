"""The telemetry of a flight, compared with what pymavlink reads of the same file."""

from pathlib import Path

import pytest
from pymavlink import mavutil

from rtshcua.app.documents import claimed
from rtshcua.app.flights.flight_telemetry import SILENT_US, TelemetryReading, Thinning, read_telemetry
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import Genesis
from rtshcua.mavlink import tlog
from rtshcua.model.flat.policy import Policy


@pytest.fixture(scope="module")
def basis(completed: Path) -> tuple[Policy, int]:
    genesis = read((completed / "log.jsonl").read_bytes().splitlines(keepends=True)[0])
    assert isinstance(genesis, Genesis)
    return claimed((completed / "mission.bundle").read_bytes()).policy, genesis.utc_us


def theirs(path: Path, name: str) -> list[tuple[int, mavutil.mavlink.MAVLink_message]]:
    log = mavutil.mavlink_connection(str(path), dialect="ardupilotmega")
    found = []
    while (message := log.recv_match(type=name)) is not None:
        if message.get_srcComponent() == 1:
            found.append((round(message._timestamp * 1e6), message))
    log.f.close()
    return found


def test_track_is_that_of_the_file(completed: Path, basis: tuple[Policy, int]) -> None:
    found = read_telemetry(completed / "telemetry.tlog", *basis)
    expected = theirs(completed / "telemetry.tlog", "GLOBAL_POSITION_INT")
    assert len(found.track) == len(expected) > 50
    for point, (at_us, message) in zip(found.track, expected, strict=True):
        assert abs(point.t_us + basis[1] - at_us) <= 1  # its time is a float
        assert (point.latitude, point.longitude) == (message.lat, message.lon)
        assert (point.above_sea, point.above_home) == (message.alt, message.relative_alt)
        assert (point.north, point.east, point.down) == (10 * message.vx, 10 * message.vy, 10 * message.vz)
    assert [boot for _, boot in found.boot_us] == [1_000 * message.time_boot_ms for _, message in expected]


def test_position_that_the_autopilot_does_not_know_is_no_point(turned: Path) -> None:
    genesis = read((turned / "log.jsonl").read_bytes().splitlines(keepends=True)[0])
    assert isinstance(genesis, Genesis)
    policy = claimed((turned / "mission.bundle").read_bytes()).policy
    found = read_telemetry(turned / "telemetry.tlog", policy, genesis.utc_us)
    expected = theirs(turned / "telemetry.tlog", "GLOBAL_POSITION_INT")
    assert len(found.boot_us) == len(found.track) < len(expected)  # ArduPilot reports 0 N 0 E at first
    assert all(point.latitude > 470_000_000 for point in found.track)


def test_charge_is_a_signal(completed: Path, basis: tuple[Policy, int]) -> None:
    found = read_telemetry(completed / "telemetry.tlog", *basis)
    battery = next(each for each in found.signals if each.name == "battery")
    known = [value for _, value in battery.points if value is not None]
    assert known
    assert all(0 < value <= 10_000 for value in known)
    assert found.damaged is None


def test_thinned_reading_has_the_same_values_less_often(completed: Path, basis: tuple[Policy, int]) -> None:
    whole = read_telemetry(completed / "telemetry.tlog", *basis)
    some = read_telemetry(completed / "telemetry.tlog", *basis, None, Thinning(2_000_000, 2_000_000))
    assert set(some.track) < set(whole.track)
    assert len(some.track) < len(whole.track) / 3
    assert all(b.t_us - a.t_us >= 2_000_000 for a, b in zip(some.track, some.track[1:], strict=False))
    assert some.reports == whole.reports


def test_growing_file_gives_the_same(completed: Path, basis: tuple[Policy, int], tmp_path: Path) -> None:
    data = (completed / "telemetry.tlog").read_bytes()
    growing = tmp_path / "telemetry.tlog"
    reading = TelemetryReading(*basis, Thinning(250_000, 250_000))
    for end in (0, 5, 1_000, 1_001, len(data) // 2, len(data)):
        growing.write_bytes(data[:end])
        reading.follow(growing)
    assert reading.telemetry() == read_telemetry(completed / "telemetry.tlog", *basis, None, Thinning(250_000, 250_000))
    assert not reading.follow(growing)


def test_cut_file_says_where(completed: Path, basis: tuple[Policy, int], tmp_path: Path) -> None:
    data = (completed / "telemetry.tlog").read_bytes()
    cut = tmp_path / "telemetry.tlog"
    cut.write_bytes(data[:-3])
    ends = [0]
    for entry in tlog.read(data):
        ends.append(ends[-1] + tlog.STAMP + len(entry.frame))
    assert read_telemetry(cut, *basis).damaged == ends[-2]
    cut.write_bytes(b"garbage that is no telemetry")
    found = read_telemetry(cut, *basis)
    assert (found.damaged, found.track) == (0, ())


def test_silence_is_stated(completed: Path, basis: tuple[Policy, int], tmp_path: Path) -> None:
    entries = list(tlog.read((completed / "telemetry.tlog").read_bytes()))
    middle = entries[len(entries) // 2].at_us
    kept = [each for each in entries if not middle <= each.at_us < middle + 5_000_000]
    (tmp_path / "t").write_bytes(b"".join(tlog.encode(each.at_us, each.frame) for each in kept))
    (silence,) = read_telemetry(tmp_path / "t", *basis).silences
    assert silence.to_us - silence.from_us >= 5_000_000 > SILENT_US
