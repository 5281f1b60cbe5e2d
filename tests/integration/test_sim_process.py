"""The simulated vehicle as a process, over UDP on loopback: it flies, hears one peer, and ends on request."""

import json
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from math import nan
from random import Random
from types import TracebackType
from typing import Any, Self

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec, ReceivedFrame
from rtshcua.simulation.process import EXIT_OK, EXIT_PORT, EXIT_USAGE, main

PATIENCE_S = 60.0
RADIUS_E7_PER_M = 89.83
MODULE = [sys.executable, "-m", "rtshcua.simulation"]


class Station:
    """A UDP port that a simulated vehicle talks to, and the process that it started for it."""

    def __init__(self, *options: str) -> None:
        self.link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.link.bind(("127.0.0.1", 0))
        self.link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4_000_000)
        self.codec = Codec(255, 190)
        self.last: dict[str, Any] = {}
        port = str(self.link.getsockname()[1])
        self.started = time.monotonic()
        self.process = subprocess.Popen(
            [*MODULE, "--port", port, *options], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        assert self.process.stdout is not None
        self.ready = json.loads(self.process.stdout.readline())
        self.vehicle = ("127.0.0.1", self.ready["local"])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self.process.kill()
        self.process.communicate()
        self.link.close()

    def frames(self) -> Iterator[ReceivedFrame]:
        """Every frame as it comes, until patience ends."""
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            if select.select([self.link], [], [], 0.2)[0]:
                data, sender = self.link.recvfrom(65_535)
                assert sender == self.vehicle
                for frame in self.codec.parse(data):
                    self.last[frame.name] = frame.message
                    yield frame
            assert self.process.poll() is None, "the vehicle's process ended"
        raise AssertionError(f"not seen in {PATIENCE_S} s: {self.last}")

    def until(self, seen: Callable[[Any], bool], name: str) -> Any:
        return next(frame.message for frame in self.frames() if frame.name == name and seen(frame.message))

    def send(self, message: Any) -> None:
        self.link.sendto(self.codec.pack(message), self.vehicle)

    def command(self, number: int, *params: float) -> None:
        """Sends a command and waits until it is accepted; a second ACK may follow, as PX4 does."""
        padded = [*params, *[0.0] * (7 - len(params))]
        self.send(mavlink.MAVLink_command_long_message(1, 1, number, 0, *padded))
        assert self.until(lambda m: m.command == number, "COMMAND_ACK").result == 0


def close_to(value: float, target: float, by: float) -> bool:
    return abs(value - target) <= by


@pytest.mark.slow
@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_simulated_vehicle_flies_out_and_home(flavour: str) -> None:
    with Station("--flavour", flavour, "--speed", "40", "--wind", "4,270,1", "--cruise", "8") as s:
        px4 = flavour == "px4"
        s.until(lambda _: True, "HEARTBEAT")
        for number in (1, 24, 33, 245, 242, 230 if px4 else 193):
            s.command(511, number, 100_000)
        home = s.until(lambda _: True, "HOME_POSITION")
        s.until(lambda m: m.fix_type >= 3, "GPS_RAW_INT")
        s.until(lambda m: m.flags & mavlink.ESTIMATOR_POS_HORIZ_ABS, "ESTIMATOR_STATUS" if px4 else "EKF_STATUS_REPORT")
        s.until(lambda m: m.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK, "SYS_STATUS")

        amsl = home.altitude / 1000
        if not px4:
            s.command(176, 1, 4)
        s.command(400, 1)
        s.command(22, -1, 0, 0, nan, nan, nan, 20 + (amsl if px4 else 0))
        s.until(lambda m: m.base_mode & 128, "HEARTBEAT")
        s.until(lambda m: close_to(m.relative_alt, 20_000, 500) and abs(m.vz) < 20, "GLOBAL_POSITION_INT")
        s.until(lambda m: m.landed_state == 2, "EXTENDED_SYS_STATE")

        north = home.latitude + round(120 * RADIUS_E7_PER_M)
        if px4:
            s.send(
                mavlink.MAVLink_command_int_message(1, 1, 5, 192, 0, 0, -1, 1, 0, nan, north, home.longitude, amsl + 25)
            )
        else:
            s.send(
                mavlink.MAVLink_set_position_target_global_int_message(
                    0, 1, 1, 6, 0xFF8, north, home.longitude, 25, 0, 0, 0, 0, 0, 0, 0, 0
                )
            )
        s.until(lambda m: close_to(m.lat, north, 100) and close_to(m.relative_alt, 25_000, 500), "GLOBAL_POSITION_INT")

        s.command(20)
        s.until(lambda m: m.landed_state == 1, "EXTENDED_SYS_STATE")
        s.until(lambda m: not m.base_mode & 128, "HEARTBEAT")
        where = s.last["GLOBAL_POSITION_INT"]
        assert close_to(where.lat, home.latitude, 100)
        assert close_to(where.relative_alt, 0, 300)


def test_first_heartbeat_is_sent_at_once() -> None:
    with Station() as s:
        s.until(lambda _: True, "HEARTBEAT")
        assert time.monotonic() - s.started < 5


def test_ready_line_is_json() -> None:
    with Station("--flavour", "ardupilot", "--system", "7", "--speed", "2") as s:
        assert s.ready["event"] == "ready"
        assert (s.ready["flavour"], s.ready["system"], s.ready["speed"]) == ("ardupilot", 7, 2.0)
        assert s.ready["peer"] == s.link.getsockname()[1]
        assert s.ready["pid"] == s.process.pid
        assert (
            next(frame.system for frame in s.frames() if frame.component == 1) == 7
        )  # the radio is a system of its own


def test_parent_can_inject_faults() -> None:
    with Station("--speed", "20") as s:
        assert s.process.stdin is not None
        s.process.stdin.write(b"rain,at=0s\nbattery,at=0s,lev")
        s.process.stdin.flush()
        s.process.stdin.write(b"el=40%\n")
        s.process.stdin.flush()
        assert any(frame.name == "BATTERY_STATUS" and frame.message.battery_remaining <= 40 for frame in s.frames())
        s.process.stdin.close()
        s.process.stdin = None
        assert s.process.wait(PATIENCE_S) == EXIT_OK
        assert s.process.stderr is not None
        assert b"no such fault: `rain`" in s.process.stderr.read()


def test_process_ends_with_its_parent() -> None:
    with Station() as s:
        assert s.process.stdin is not None
        s.process.stdin.close()
        s.process.stdin = None
        assert s.process.wait(PATIENCE_S) == EXIT_OK


def test_process_ends_on_sigterm_but_not_on_ctrl_c() -> None:
    with Station("--speed", "20") as s:
        s.process.send_signal(signal.SIGINT)
        s.until(lambda m: m.time_boot_ms > 3_000, "GLOBAL_POSITION_INT")
        s.process.send_signal(signal.SIGTERM)
        assert s.process.wait(PATIENCE_S) == EXIT_OK


def test_only_the_peer_is_heard_and_garbage_is_survived() -> None:
    chance = Random(9)
    with Station("--speed", "20") as s, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        s.until(lambda m: m.fix_type >= 3, "GPS_RAW_INT")
        arm = mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
        stranger.sendto(Codec(255, 190).pack(arm), s.vehicle)
        for _ in range(60):
            s.link.sendto(chance.randbytes(chance.randrange(400)), s.vehicle)
        s.command(512, 148)
        assert s.last["AUTOPILOT_VERSION"].flight_sw_version >> 24 == 1
        assert not s.until(lambda _: True, "HEARTBEAT").base_mode & 128


def test_faults_reach_the_vehicle() -> None:
    with Station("--speed", "20", "--battery", "80", "--fault", "battery,at=4s,level=22%") as s:
        assert s.until(lambda _: True, "BATTERY_STATUS").battery_remaining in (79, 80)
        assert s.until(lambda m: m.battery_remaining < 50, "BATTERY_STATUS").battery_remaining in (21, 22)


def test_busy_port_is_reported() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        port = other.getsockname()[1]
        done = subprocess.run(
            [*MODULE, "--port", "14550", "--bind", str(port)], capture_output=True, text=True, check=False
        )
    assert done.returncode == EXIT_PORT
    assert done.stderr == f"error: cannot bind UDP port {port}: address already in use\n"
    assert done.stdout == ""


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "required: --port"),
        (["--port", "0"], "`0` is not a number from 1 to 65535"),
        (["--port", "x"], "`x` is not a number from 1 to 65535"),
        (["--port", "14550", "--speed", "nan"], "`nan` is not a number"),
        (["--port", "14550", "--flavour", "betaflight"], "invalid choice"),
        (["--port", "14550", "--home", "1,2"], "`1,2` is not LAT,LON,AMSL"),
        (["--port", "14550", "--home=-89,2,3"], "latitude of home must be from -85 to 85 degrees"),
        (["--port", "14550", "--fault", "rain"], "no such fault: `rain`"),
        (["--port", "14550", "--signing-key", "/nowhere"], "cannot read `/nowhere`"),
        (["--port", "14550", "--signing-key", "/dev/null"], "`/dev/null` does not hold a key"),
    ],
)
def test_invalid_options_are_refused(options: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    try:
        code = main(options)
    except SystemExit as end:  # of argparse
        code = int(end.code or 0)
    assert code == EXIT_USAGE
    assert message in capsys.readouterr().err


def test_invalid_options_print_no_traceback() -> None:
    done = subprocess.run([*MODULE, "--port", "0"], capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    assert done.returncode == EXIT_USAGE
    assert "Traceback" not in done.stderr
