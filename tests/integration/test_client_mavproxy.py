"""MAVProxy flies the simulated vehicle: the test types commands at its console and reads effects there."""

import os
import re
import select
import subprocess
import sys
import sysconfig
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO

import pytest

from rtshcua.adapters.simulator import Simulator

pytest.importorskip("MAVProxy", reason="MAVProxy is installed on Linux only")
pytestmark = pytest.mark.clients

SPEED = 15
PATIENCE_S = 90.0
AGAIN_S = 2.0
MODULES = "signing,wp,fence,param,arm,mode,misc,cmdlong"
WATCHED = ("HEARTBEAT", "GLOBAL_POSITION_INT", "MISSION_ITEM_REACHED", "PARAM_VALUE")
THIN = dict.fromkeys((30, 74, 132, 147, 230, 231), -1) | {33: 500_000}
"""SET_MESSAGE_INTERVAL for what PX4 streams unasked: sped up, that is more than MAVProxy can read on a busy machine."""
ARMED = 128
AMSL_M = 488
E7_PER_M = 89.83
MODES = {
    "px4": {"TAKEOFF": 2 << 24 | 4 << 16, "MISSION": 4 << 24 | 4 << 16, "LAND": 6 << 24 | 4 << 16},
    "ardupilot": {"GUIDED": 4, "MISSION": 3, "LAND": 9},
}
HOME = (47.39774, 8.54559)
NORTH = (47.39792, 8.54559)
NORTH_EAST = (47.39792, 8.54580)
NOWHERE = (0.0, 0.0)
FENCE = [(47.3970, 8.5445), (47.3970, 8.5467), (47.3985, 8.5467), (47.3985, 8.5445)]

Row = tuple[int, int, float, tuple[float, float], float]
"""An item of a plan: command, frame, parameter 1, latitude and longitude, altitude."""


class Console:
    """A MAVProxy that listens on a UDP port, in a folder of its own. It ends when its input does, and so with us."""

    def __init__(self, folder: Path, port: int) -> None:
        script = str(Path(sysconfig.get_path("scripts")) / "mavproxy.py")
        options = [f"--master=udpin:127.0.0.1:{port}", f"--default-modules={MODULES}", "--no-state"]
        options += ["--dialect=ardupilotmega", "--streamrate=2"]
        self._folder = folder
        self.last: dict[str, dict[str, int]] = {name: {} for name in WATCHED}
        """The fields of the vehicle's last messages of each kind that is watched."""
        self._said: list[str] = []
        self._lines: deque[str] = deque()
        self._rest = b""
        self._process = subprocess.Popen(
            [sys.executable, script, *options],
            cwd=folder,
            env=os.environ | {"HOME": str(folder), "PYTHONUNBUFFERED": "1"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._in: IO[bytes] = self._process.stdin
        self._out: IO[bytes] = self._process.stdout

    def type(self, words: str) -> None:
        self._in.write(words.encode() + b"\n")
        self._in.flush()

    def until(self, wanted: str, limit_s: float = PATIENCE_S) -> None:
        """Waits for a line in which this pattern is found."""
        deadline = time.monotonic() + limit_s
        while not re.search(wanted, self._read(deadline, wanted)):
            pass

    def ask(self, words: str, *wanted: str) -> None:
        """Types a command and waits for what it brings about, one after the other."""
        self.type(words)
        for pattern in wanted:
            self.until(pattern)

    def insist(self, words: str, wanted: str) -> None:
        """Types a command until it brings about what is wanted: on a busy machine datagrams get lost."""
        for _ in range(int(PATIENCE_S / AGAIN_S)):
            self.type(words)
            with suppress(AssertionError):
                return self.until(wanted, AGAIN_S)
        raise AssertionError(f"`{words}` never brought {wanted}; it said: {self._said}")

    def load(self, kind: str, rows: list[Row]) -> None:
        """Loads a plan from a file into the vehicle, and reads it back."""
        lines = ["QGC WPL 110"]
        for number, (command, frame, first, place, up) in enumerate(rows):
            fields = (number, 0, frame, command, first, 0, 0, 0, *place, up, 1)
            lines.append("\t".join(map(str, fields)))
        (self._folder / "plan.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
        self.insist(f"{kind} load plan.txt", "MISSION_ACK: TYPE_.*: ACCEPTED")
        back = [f"{row[0]} {row[1]} {row[3][0]:.10f} {row[3][1]:.10f} {row[4]:.6f} p1={row[2]} " for row in rows]
        self.ask(f"{kind} list", *map(re.escape, back))

    def see(self, wanted: Callable[[], bool], what: str) -> None:
        """Waits until what the vehicle tells fits."""
        deadline = time.monotonic() + PATIENCE_S
        while not wanted():
            self._read(deadline, what)

    def see_mode(self, number: int) -> None:
        self.see(lambda: self.last["HEARTBEAT"].get("custom_mode") == number, f"mode {number}")

    def see_armed(self, armed: bool) -> None:
        self.see(lambda: bool(self.last["HEARTBEAT"].get("base_mode", 0) & ARMED) is armed, f"armed: {armed}")

    def see_nothing_answered(self, heartbeats: int) -> None:
        """Waits for so many heartbeats, without a COMMAND_ACK among them."""
        deadline = time.monotonic() + PATIENCE_S
        while heartbeats:
            line = self._read(deadline, "heartbeats")
            assert "COMMAND_ACK" not in line
            heartbeats -= "< HEARTBEAT" in line

    def see_reached(self, number: int) -> None:
        """Items are reached in their order: a busy machine may miss a message, and see that of a later one."""
        self.see(lambda: self.last["MISSION_ITEM_REACHED"].get("seq", -1) >= number, f"item {number} reached")

    def see_at(self, place: tuple[float, float], up: float) -> None:
        """Waits until the vehicle is within two metres of a place."""

        def there() -> bool:
            where = self.last["GLOBAL_POSITION_INT"]
            away = max(abs(where["lat"] - place[0] * 1e7), abs(where["lon"] - place[1] * 1e7))
            return away < 2 * E7_PER_M and abs(where["relative_alt"] - up * 1000) < 2_000

        self.see(there, f"at {place}, {up} m")

    def close(self) -> None:
        self._process.kill()
        self._process.communicate()

    def _read(self, deadline: float, wanted: str) -> str:
        """The next line that it says; every one is read, and each message of the vehicle is looked at, in order."""
        while not self._lines:
            ready = select.select([self._out], [], [], max(0.0, deadline - time.monotonic()))[0]
            data = os.read(self._out.fileno(), 65_536) if ready else b""
            assert data, f"not seen: {wanted}; {self.last}; it said: {self._said}"
            *lines, self._rest = (self._rest + data).split(b"\n")
            self._lines.extend(line.decode() for line in lines)
        line = self._lines.popleft()
        if message := re.search(r"< (\w+) \{(.*)\}", line):
            self.last[message[1]] = {name: int(value) for name, value in re.findall(r"(\w+) : (-?\d+)", message[2])}
        elif not line.startswith("> "):
            self._said.append(line)
        return line


@pytest.fixture(params=["px4", "ardupilot"])
def flavour(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def console(flavour: str, tmp_path: Path, port: int) -> Iterator[Console]:
    """A MAVProxy that a simulated vehicle is linked to, and that sees its position and its heartbeat."""
    with Simulator(["--port", str(port), "--speed", str(SPEED), "--hover", "60", "--flavour", flavour]):
        made = Console(tmp_path, port)
        try:
            made.until("Detected vehicle 1:1")
            for message, interval_us in THIN.items() if flavour == "px4" else ():
                made.type(f"long SET_MESSAGE_INTERVAL {message} {interval_us}")
            made.ask(f"watch {' '.join(WATCHED)}", "Watching")
            made.until(r"Received \d+ parameters")
            made.see(lambda: bool(made.last["HEARTBEAT"] and made.last["GLOBAL_POSITION_INT"]), "where it is")
            yield made
        finally:
            made.close()


def arm(console: Console) -> None:
    """Arms, as often as it takes: nobody is told when the vehicle is ready."""
    console.insist("arm throttle", "COMPONENT_ARM_DISARM: ACCEPTED")
    console.see_armed(True)


def test_mavproxy_console_flies_the_vehicle(console: Console, flavour: str) -> None:
    px4 = flavour == "px4"
    modes = MODES[flavour]

    # Settings: the vehicle shall wait on the ground, however slow this machine is, and land fast.
    patient, landing = ("COM_DISARM_PRFLT", "MPC_LAND_SPEED") if px4 else ("DISARM_DELAY", "LAND_SPEED")
    for name, value in ((patient, 120), (landing, 2 if px4 else 200)):
        console.insist(f"param set {name} {value}", rf"PARAM_VALUE .*: {name}, param_value : {value}\.0")

    if not px4:
        console.ask("signing setup passphrase", "Sent secret_key")  # all that follows is signed, both ways

    # Fence and mission, to the vehicle and back.
    console.load("fence", [(5001, 3, 4.0, corner, 0.0) for corner in FENCE])
    console.load(
        "wp",
        [
            (16, 0, 0.0, HOME, float(AMSL_M)),
            (22, 3, 0.0, NOWHERE, 8.0),
            (16, 3, 0.0, NORTH_EAST, 10.0),
            (16, 3, 0.0, NORTH, 10.0),
            (20, 3, 0.0, NOWHERE, 0.0),
        ],
    )

    # Off the ground, and to a place.
    if not px4:
        console.type("mode guided")
        console.see_mode(modes["GUIDED"])
    arm(console)
    if px4:
        # PX4 takes the height for one above the sea: it accepts, and stays where it is.
        console.type("takeoff 10")
        console.see_mode(modes["TAKEOFF"])
    console.type(f"takeoff {AMSL_M + 8 if px4 else 8}")
    console.see_at(HOME, 8)
    console.insist("disarm", f"COMPONENT_ARM_DISARM: {'TEMPORARILY_REJECTED' if px4 else 'FAILED'}")
    console.type(f"guided {NORTH[0]} {NORTH[1]} {AMSL_M + 12 if px4 else 12}")
    console.see_at(NORTH, 12)

    # The mission, home again at its end. MAVProxy's `mode` cannot set PX4's modes.
    console.type("long MISSION_START" if px4 else "mode auto")
    console.see_mode(modes["MISSION"])
    console.see_reached(2)
    console.see_reached(3)
    console.see_at(HOME, 0)
    console.see_armed(False)

    # Up and down, and disarmed by hand.
    if not px4:
        console.type("mode guided")
        console.see_mode(modes["GUIDED"])
    arm(console)
    console.type(f"takeoff {AMSL_M + 6 if px4 else 6}")
    console.see_at(HOME, 6)
    console.type("long NAV_LAND" if px4 else "mode land")
    console.see_mode(modes["LAND"])
    console.see_at(HOME, 0)
    console.see_armed(False)
    if not px4:
        console.type("mode guided")
        console.see_mode(modes["GUIDED"])
    arm(console)
    console.type("disarm")
    console.see_armed(False)

    if not px4:
        # Unsigned, nothing has an effect.
        console.ask("signing disable", "Disabled signing")
        console.type("arm throttle")
        console.see_nothing_answered(20)
        console.see_armed(False)
