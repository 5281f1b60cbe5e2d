"""A gateway in a process of its own, and a script as its client: pymavlink over UDP, as people write it."""

import json
import math
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from pymavlink.dialects.v20 import ardupilotmega as mavlink

os.environ.setdefault("MAVLINK20", "1")
from pymavlink import mavutil

#: a field of 240 m by 220 m around the simulated vehicle's home
KML = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2"><Placemark><name>field</name><Polygon><outerBoundaryIs><LinearRing>
<coordinates>8.5440,47.3967,0 8.5470,47.3967,0 8.5470,47.3987,0 8.5440,47.3987,0 8.5440,47.3967,0</coordinates>
</LinearRing></outerBoundaryIs></Polygon></Placemark></kml>
"""
#: the longest that a test waits for anything, in seconds; a flight on a busy machine takes two minutes
PATIENCE_S = 150.0
IN_PROGRESS = mavlink.MAV_RESULT_IN_PROGRESS
NAN = math.nan


class GatewayRun:
    """`rtshcua gateway` with these options, until it ends."""

    def __init__(self, folder: Path, *words: str) -> None:
        self.folder = folder
        self.data = folder / "data"
        environment = os.environ | {"RTSHCUA_DATA_DIR": str(self.data)}
        self.began_s = time.monotonic()
        self._errors = (folder / "errors.txt").open("wb")
        self.process = subprocess.Popen(
            [sys.executable, "-m", "rtshcua", "gateway", *words, "--json"], cwd=folder, env=environment,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=self._errors,
        )  # fmt: skip
        assert self.process.stdout is not None
        os.set_blocking(self.process.stdout.fileno(), False)
        self._rest = b""
        self.events: list[dict[str, Any]] = []

    @property
    def root(self) -> Path:
        """The trust root of the development keys."""
        return self.data / "gateway-development/keys/root.trust"

    def read(self) -> None:
        """Take in what it has printed."""
        assert self.process.stdout is not None
        *lines, self._rest = (self._rest + (self.process.stdout.read() or b"")).split(b"\n")
        self.events += [json.loads(line) for line in lines if line.strip()]

    def all(self, event: str) -> list[dict[str, Any]]:
        """The events of a name."""
        self.read()
        return [each for each in self.events if each.get("event") == event]

    def wait_for(self, event: str, number: int = 1) -> dict[str, Any]:
        """The nth event of a name."""
        end_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < end_s:
            found = self.all(event)
            if len(found) >= number:
                return found[number - 1]
            assert self.process.poll() is None, self.errors
            time.sleep(0.05)
        raise AssertionError(f"no `{event}` among {self.events}\n{self.errors}")

    def interrupt(self) -> int:
        """Ctrl-C; return the exit code."""
        self.process.send_signal(signal.SIGINT)
        return self.wait()

    def wait(self) -> int:
        """Wait for its end."""
        end_s = time.monotonic() + PATIENCE_S
        while self.process.poll() is None and time.monotonic() < end_s:
            self.read()  # it must not wait for us
            time.sleep(0.05)
        self.read()
        assert self.process.returncode is not None, self.errors
        return self.process.returncode

    @property
    def errors(self) -> str:
        """What it printed as errors."""
        return (self.folder / "errors.txt").read_text("utf-8", "replace")

    def stop(self) -> None:
        """End it, whatever it does."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        assert self.process.stdout is not None
        self.process.stdout.close()
        self._errors.close()


#: how often a command is sent that nobody answers, and after how long again, in s
_TRIES: Final = 5
_AGAIN_S: Final = 5.0


class ScriptClient:
    """A script that flies by COMMAND_LONG and COMMAND_INT, and reads acknowledgements and texts."""

    def __init__(self, port: int, system: int = 250, scheme: str = "udpout") -> None:
        self.link = mavutil.mavlink_connection(
            f"{scheme}:127.0.0.1:{port}", source_system=system, dialect="ardupilotmega"
        )
        self.texts: list[str] = []
        self._text = ""
        self._beat_s = 0.0
        self.px4 = False

    def meet(self) -> None:
        """Wait for the vehicle's heartbeat and its position."""
        beat = self.until(lambda each: each.get_type() == "HEARTBEAT" and each.get_srcComponent() == 1)
        self.px4 = beat.autopilot == mavlink.MAV_AUTOPILOT_PX4
        self.link.target_system = beat.get_srcSystem()
        self.position()

    def until(self, wanted: Callable[[Any], bool], seconds: float = PATIENCE_S) -> Any:
        """The next message that is wanted; heartbeats are sent meanwhile."""
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            if time.monotonic() - self._beat_s > 0.8:
                self._beat_s = time.monotonic()
                self.link.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4)
            message = self.link.recv_match(blocking=True, timeout=0.1)
            if message is None:
                continue
            if message.get_type() == "STATUSTEXT":
                self._hear(message)
            if wanted(message):
                return message
        raise AssertionError(f"waited in vain; texts: {self.texts}")

    def _hear(self, message: Any) -> None:
        """Join the chunks of a text (STATUSTEXT, `id` and `chunk_seq`)."""
        self._text = (self._text if message.chunk_seq else "") + message.text
        if message.id == 0 or len(message.text) < 50:
            self.texts.append(" ".join(self._text.split()))

    def position(self) -> Any:
        """The vehicle's position now."""
        return self.until(lambda each: each.get_type() == "GLOBAL_POSITION_INT")

    def result(self, command: int, seconds: float = PATIENCE_S) -> int:
        """The last COMMAND_ACK of a command: not IN_PROGRESS."""
        found = self.until(
            lambda each: each.get_type() == "COMMAND_ACK" and each.command == command and each.result != IN_PROGRESS,
            seconds,
        )
        return int(found.result)

    def command(self, command: int, *values: float) -> int:
        """Send a COMMAND_LONG and return its result. It is sent again while nothing is answered, as clients do: a
        datagram may be lost on a busy machine.
        """
        values = (*values, *[0.0] * (7 - len(values)))
        answers: list[int] = []

        def answered(message: Any) -> bool:
            if message.get_type() == "COMMAND_ACK" and message.command == command:
                answers.append(int(message.result))
                return True
            return bool(time.monotonic() >= again_s)

        for confirmation in range(_TRIES):
            again_s = time.monotonic() + _AGAIN_S
            self.link.mav.command_long_send(self.link.target_system, 1, command, confirmation, *values)
            self.until(answered)
            if answers:
                break
        return self.result(command) if not answers or answers[0] == IN_PROGRESS else answers[0]

    def takeoff(self, height_m: float) -> int:
        """Ask for a take-off to a height above home, as the autopilot reads it."""
        here = self.position()
        ground_m = (here.alt - here.relative_alt) / 1_000 if self.px4 else 0.0
        return self.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, NAN, NAN, NAN, ground_m + height_m)

    def goto(self, latitude: float, longitude: float, height_m: float) -> int:
        """Ask for a go-to, with the height above home."""
        self.link.mav.command_int_send(
            self.link.target_system, 1, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_CMD_DO_REPOSITION, 0, 0,
            -1, 1, 0, NAN, round(latitude * 1e7), round(longitude * 1e7), height_m,
        )  # fmt: skip
        return self.result(mavlink.MAV_CMD_DO_REPOSITION)

    def until_higher(self, height_m: float) -> None:
        """Wait until the vehicle is higher above home."""
        self.until(lambda each: each.get_type() == "GLOBAL_POSITION_INT" and each.relative_alt > height_m * 1_000)

    def until_at(self, latitude: float, longitude: float) -> None:
        """Wait until the vehicle is within some 4 m of a place."""

        def arrived(message: Any) -> bool:
            if message.get_type() != "GLOBAL_POSITION_INT":
                return False
            north, east = message.lat - latitude * 1e7, (message.lon - longitude * 1e7) * 0.68
            return math.hypot(north, east) < 400

        self.until(arrived)

    def until_disarmed(self) -> None:
        """Wait until the vehicle's heartbeat is not armed."""
        armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        self.until(
            lambda each: each.get_type() == "HEARTBEAT" and each.get_srcComponent() == 1 and not each.base_mode & armed
        )

    def retry(self, asked: Callable[[], int], accepted: int = mavlink.MAV_RESULT_ACCEPTED) -> None:
        """Ask again while the answer is TEMPORARILY_REJECTED, as right after the start."""
        end_s = time.monotonic() + PATIENCE_S
        while (result := asked()) == mavlink.MAV_RESULT_TEMPORARILY_REJECTED:
            assert time.monotonic() < end_s, self.texts
            self.until_s(0.5)
        assert result == accepted, (result, self.texts)

    def until_s(self, seconds: float) -> None:
        """Listen for a time."""
        end_s = time.monotonic() + seconds
        self.until(lambda _: time.monotonic() >= end_s)

    def close(self) -> None:
        """End the client."""
        self.link.close()


def verified(run: GatewayRun, commands: Sequence[str], folder: Path) -> subprocess.CompletedProcess[str]:
    """Verify a log with `rtshcua verify-log` in a process."""
    return subprocess.run(
        [sys.executable, "-m", "rtshcua", "verify-log", *commands, "--root", str(run.root)],
        cwd=folder, capture_output=True, text=True, check=False, timeout=PATIENCE_S,
    )  # fmt: skip


def free_port() -> int:
    """A UDP port that was free a moment ago."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def running(folder: Path, *words: str) -> Iterator[tuple[GatewayRun, ScriptClient]]:
    """The gateway with the rules of a field, and a script at it."""
    (folder / "field.kml").write_text(KML)
    port = free_port()
    quick = ("--allow", "takeoff,goto,land", "--below", "30", "m", "--inside", "field.kml")
    run = GatewayRun(folder, *quick, "--client", f"script=udpin:127.0.0.1:{port}", *words)
    client = ScriptClient(port)
    try:
        yield run, client
    finally:
        client.close()
        run.stop()


def taken_off(client: ScriptClient, height_m: float = 6.0) -> None:
    """Let a script take off, once the vehicle is ready."""
    client.meet()
    client.retry(lambda: client.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1))
    client.retry(lambda: client.takeoff(height_m))
    client.until_higher(height_m - 1.2)
