"""Logs of autopilots: every release's fields, damaged files, hostile files, files of other kinds."""

import os
import struct
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from reference import dataflash_writer as df
from reference import ulog_writer as ul
from reference.autopilot_logs import ardupilot_log, px4_log
from rtshcua.adapters.autopilot_log import limited_reading as reading
from rtshcua.adapters.autopilot_log.limited_reading import ReadFile, read_autopilot_log
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.flight.autopilot_log import AutopilotLogKind, AutopilotPoint, LogCondition, UtcOfBoot

TRACK = tuple(
    AutopilotPoint(7_000_000 + 200_000 * n, 473_977_397 + 11 * n, -85_455_902 - 7 * n, 488_000 + 125 * n)
    for n in range(60)
)
BOOTED_US = 1_790_000_000_000_000
P = 20  # points of the tables below


def read(path: Path, data: bytes) -> ReadFile | Refusal:
    path.write_bytes(data)
    return read_autopilot_log(path)


def whole(path: Path, data: bytes) -> reading.AutopilotLog:
    found = read(path, data)
    assert isinstance(found, ReadFile), found
    assert found.log.condition is LogCondition.WHOLE
    return found.log


def refused(path: Path, data: bytes) -> Refusal:
    found = read(path, data)
    assert isinstance(found, Refusal)
    return found


@pytest.mark.parametrize(("kind", "log"), [("ulog", px4_log), ("dataflash", ardupilot_log)])
def test_track_and_utc_are_those_written(kind: str, log: Any, tmp_path: Path) -> None:
    found = whole(tmp_path / "a", log(TRACK, BOOTED_US))
    assert found.kind is AutopilotLogKind(kind)
    assert found.track == TRACK
    assert found.utc_of_boot == UtcOfBoot(BOOTED_US, 0)
    assert whole(tmp_path / "a", log(TRACK)).utc_of_boot is None


def px4_releases() -> dict[str, tuple[dict[str, Any], Any, str]]:
    def degrees(at: AutopilotPoint) -> tuple[float, float, float]:
        return at.latitude / 1e7, at.longitude / 1e7, at.above_sea / 1e3

    position, receivers = "vehicle_global_position", ul.RECEIVER
    integers = ("vehicle_gps_position", lambda at: (at.boot_us, 0, *at[1:], 0, 3))
    return {
        "estimator of old releases": (
            {position: ul.POSITION["old"]}, lambda at: (position, (at.boot_us, *degrees(at), 1.0)), position,
        ),
        "receiver in integers": (
            {integers[0]: receivers[integers[0]]}, lambda at: (integers[0], integers[1](at)), integers[0],
        ),
        "receiver in degrees": (
            {"sensor_gps": receivers["sensor_gps"]}, lambda at: ("sensor_gps", (at.boot_us, *degrees(at), 0, 0, 6)),
            "sensor_gps",
        ),
        "receiver of 2026": (
            {"vehicle_gnss": receivers["vehicle_gnss"]},
            lambda at: ("vehicle_gnss", (at.boot_us, *degrees(at), 0, 0, 3)), "vehicle_gnss",
        ),
    }  # fmt: skip


@pytest.mark.parametrize("release", px4_releases())
def test_fields_of_px4_releases(release: str, tmp_path: Path) -> None:
    formats, data, source = px4_releases()[release]
    found = whole(tmp_path / "a.ulg", ul.ulog(formats, [data(at) for at in TRACK[:P]]))
    assert found.source == source
    assert found.track == TRACK[:P]


def test_invalid_positions_of_px4_do_not_count(tmp_path: Path) -> None:
    formats = {"vehicle_global_position": ul.POSITION["new"]}
    cases = [(47.0, 8.0, 488.0, True, True), (47.0, 8.0, 488.0, False, True), (47.0, 8.0, 488.0, True, False),
             (float("nan"), 8.0, 488.0, True, True), (47.0, 8.0, float("inf"), True, True),
             (91.0, 8.0, 488.0, True, True), (47.0, 8.0, 488.5, True, True)]  # fmt: skip
    data = [("vehicle_global_position", (1_000_000 * n, 0, *each)) for n, each in enumerate(cases, 1)]
    found = whole(tmp_path / "a.ulg", ul.ulog(formats, data))
    assert [each.boot_us for each in found.track] == [1_000_000, 7_000_000]


def test_fields_of_ardupilot_releases(tmp_path: Path) -> None:
    old = df.dataflash({"POS": df.OLD_POS}, [("POS", (*at[:3], at.above_sea / 1e3, 0)) for at in TRACK[:P]])
    assert whole(tmp_path / "a.bin", old).track == TRACK[:P]
    gps = [(at, (*at[1:3], at.above_sea // 10, 0, 0, 0)) for at in TRACK[:P]]
    in_40 = [("GPS", (at.boot_us, 3, 0, 0, 12, 80, *place, 1)) for at, place in gps]
    found = whole(tmp_path / "a.bin", df.dataflash({"GPS": df.OLD_GPS}, in_40))
    assert found.source == "GPS"
    assert found.track == tuple(at._replace(above_sea=at.above_sea // 10 * 10) for at in TRACK[:P])
    second = [("GPS", (at.boot_us, 1, 3, 0, 0, 12, 80, *place, 0, 1)) for at, place in gps]
    no_fix = [("GPS", (at.boot_us, 0, 1, 0, 0, 12, 80, *place, 0, 1)) for at, place in gps]
    for unused in (second, no_fix):
        assert refused(tmp_path / "a.bin", df.dataflash(df.KINDS, unused)).slug == "no-track"


@pytest.mark.parametrize("log", [px4_log, ardupilot_log])
def test_cut_file_is_read_as_far_as_it_goes(log: Any, tmp_path: Path) -> None:
    data = log(TRACK)
    for cut in (5, 700):
        found = read(tmp_path / "a", data[:-cut])
        assert isinstance(found, ReadFile)
        assert found.log.condition is not LogCondition.DAMAGED
        assert found.log.track == TRACK[: len(found.log.track)]
        assert len(found.log.track) > 30
    found = read(tmp_path / "a", data[:-5])
    assert isinstance(found, ReadFile)
    assert found.log.condition is LogCondition.CUT


def test_one_unknown_message_does_not_hide_the_rest(tmp_path: Path) -> None:
    data = bytearray(ardupilot_log(TRACK))
    at = data.rfind(b"\xa3\x95\x45", 0, len(data) - 1_000)
    data[at + 2] = 0x99
    found = read(tmp_path / "a.bin", bytes(data))
    assert isinstance(found, ReadFile)
    assert found.log.condition is LogCondition.DAMAGED
    assert len(found.log.track) == len(TRACK) - 1
    assert found.log.track[-1] == TRACK[-1]


def test_padding_of_a_block_is_no_damage(tmp_path: Path) -> None:
    assert whole(tmp_path / "a.bin", ardupilot_log(TRACK) + b"\xff" * 200).track == TRACK


def test_other_files_are_refused_by_their_kind(tmp_path: Path) -> None:
    path = tmp_path / "a.ulg"
    assert "an empty file" in refused(path, b"").text
    assert "a flight log" in refused(path, b'{"_prev":"0').text
    assert refused(path, b"\0" * 100).text == f"`{path}` is not an autopilot's log"
    assert refused(path, b"ULog\x01\x12\x35").slug == "malformed"
    assert refused(path, px4_log(())).slug == "no-track"
    assert refused(path, ardupilot_log(())).slug == "no-track"
    assert refused(path, px4_log(TRACK[:1])).slug == "no-track"
    with pytest.raises(FileNotFoundError):
        read_autopilot_log(tmp_path / "none")
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="not a regular file"):
        read_autopilot_log(tmp_path / "pipe")


def test_too_large_file_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "a.ulg"
    with path.open("wb") as file:
        file.write(px4_log(TRACK))
        file.truncate(reading.LARGEST + 1)
    found = read_autopilot_log(path)
    assert isinstance(found, Refusal)
    assert (found.slug, found.code) == ("too-large", ExitCode.INPUT)


def test_missing_package_is_named_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    (tmp_path / "pyulog.py").write_text("raise ModuleNotFoundError(name='pyulog')")
    found = refused(tmp_path / "a.ulg", px4_log(TRACK))
    assert (found.slug, found.code) == ("no-library", ExitCode.INPUT)
    assert "`pyulog`" in found.text
    assert "rtshcua[bind]" in found.help


def bomb() -> bytes:
    """Formats that nest: 65,535 fields of 65,535 fields of 65,535 numbers."""
    parts = [b"ULog\x01\x12\x35\x01" + bytes(8), ul.message("B", bytes(40))]
    parts += [ul.message("F", b"vehicle_global_position:a[65535] x;"), ul.message("F", b"a:b[65535] x;")]
    parts += [
        ul.message("F", b"b:double[65535] x;"),
        ul.message("A", struct.pack("<BH", 0, 0) + b"vehicle_global_position"),
    ]
    return b"".join(parts)


@pytest.mark.slow
def test_hostile_files_take_bounded_time_and_memory(tmp_path: Path) -> None:
    ring = b"".join([
        b"ULog\x01\x12\x35\x01" + bytes(8), ul.message("B", bytes(40)),
        ul.message("F", b"vehicle_global_position:vehicle_global_position x;"),
        ul.message("A", struct.pack("<BH", 0, 0) + b"vehicle_global_position"),
    ])  # fmt: skip
    assert refused(tmp_path / "ring.ulg", ring).slug == "malformed"
    search = b"ULog\x01\x12\x35\x01" + bytes(8) + b"\xff" * 300_000
    assert refused(tmp_path / "search.ulg", search).slug == "malformed"
    endless = df.described("POS", df.KINDS["POS"], 0) + b"\xa3\x95\x45" * 1_000
    assert refused(tmp_path / "endless.bin", endless).slug in ("malformed", "no-track")
    assert refused(tmp_path / "bomb.ulg", bomb()).slug == "malformed"


@pytest.mark.slow
@settings(max_examples=settings().max_examples * 2, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_flipped_bytes_never_raise(tmp_path: Path, data: st.DataObject) -> None:
    log = bytearray(data.draw(st.sampled_from((px4_log, ardupilot_log)))(TRACK, BOOTED_US))
    for place, value in data.draw(st.lists(st.tuples(st.integers(8, len(log) - 1), st.integers(0, 255)), max_size=20)):
        log[place] = value
    found = read(tmp_path / "a", bytes(log[: data.draw(st.integers(8, len(log)))]))
    if isinstance(found, Refusal):
        assert found.text
        return
    times = [each.boot_us for each in found.log.track]
    assert len(times) > 1
    assert times == sorted(set(times))
