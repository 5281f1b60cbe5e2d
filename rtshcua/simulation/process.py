"""The simulated vehicle as a process: `python -m rtshcua.simulation --port 14550`.

A loop around `world.Simulation`: one UDP socket on the loopback interface, one peer, real time multiplied by `--speed`.
The process prints one line of JSON when it is ready. It ends on SIGTERM, and, if its standard input is a pipe, when the
pipe closes, so that it does not outlive its parent. Each line of standard input is a fault in the syntax of `--fault`,
with its time counted from now, or `heard` and the time since boot, in us, of the last received position (`Pace`).
"""

import argparse
import json
import os
import selectors
import signal
import socket
import stat
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from rtshcua.mavlink.signing import KEY_OCTETS
from rtshcua.simulation.autopilot import TICK_US
from rtshcua.simulation.config import (
    EQUIPPED,
    HOME,
    STOCK,
    Answers,
    AutopilotKind,
    Boot,
    Equipment,
    Estimate,
    OtherBattery,
    Purpose,
    SimulationConfig,
)
from rtshcua.simulation.fault_syntax import parse_fault
from rtshcua.simulation.place import HomePosition
from rtshcua.simulation.simulated_mark import hundredths
from rtshcua.simulation.surroundings import Wind
from rtshcua.simulation.world import Simulation


def parser() -> argparse.ArgumentParser:
    """Return the parser; each option is checked on its own."""
    options = argparse.ArgumentParser(prog="python -m rtshcua.simulation", description="A simulated multirotor.")
    add = options.add_argument
    add("--port", type=_number(int, 1, 65_535), required=True, help="the peer's UDP port on the loopback interface")
    add("--bind", type=_number(int, 0, 65_535), default=0, help="own UDP port; 0 (default): any free port")
    add("--flavour", choices=list(AutopilotKind), default=AutopilotKind.PX4)
    add("--system", type=_number(int, 1, 255), default=1, help="MAVLink system id")
    add("--speed", type=_number(float, 0.01, 200), default=1.0, help="simulated seconds per second")
    add("--seed", type=int, default=1)
    add(
        "--home",
        type=_listed("LAT,LON,AMSL", 3, 3),
        help="degrees, degrees, metres above sea level; southern latitude: --home=-35.3,149.1,584",
    )
    add("--battery", type=_number(float, 0, 100), default=100.0, help="initial level, %%")
    add(
        "--other-battery",
        type=_other_battery,
        action="append",
        default=[],
        metavar="PURPOSE,LEVEL[,SECONDS]",
        help=f"another battery: {', '.join(Purpose)}, initial level in %%, report interval; repeatable",
    )
    add("--hover", type=_number(float, 0.1, 600), default=18.0, help="hover time of a full battery, minutes")
    add("--cruise", type=_number(float, 0.1, 12), default=5.0, help="m/s")
    add("--return-at", type=_number(float, 2, 1000), default=30.0, help="height of a return, metres above home")
    add("--wind", type=_listed("SPEED,FROM[,GUST]", 2, 3), default=[0.0, 0.0], help="m/s, degrees, m/s")
    add("--no-noise", action="store_true", help="no sensor noise")
    add(
        "--estimate",
        choices=list(Estimate),
        default=Estimate.CLOSE,
        help="accuracy of the position estimate: centimetres, or realistic",
    )
    add("--answers", choices=list(Answers), default=Answers.RECORDED, help="delay of answers: none, or as recorded")
    add("--boot", choices=list(Boot), default=Boot.FAST, help="boot time: one second, or as recorded")
    add("--stock", action="store_true", help="GPS, barometer and battery only")
    add("--extra", choices=list(Equipment), action="append", help="equipment instead of the default; repeatable")
    fitted = argparse.BooleanOptionalAction
    add("--camera", action=fitted, default=False, help="a camera: on PX4 component 100, else the autopilot's")
    add("--gimbal", action=fitted, default=False, help="a gimbal that carries the camera: on PX4 component 154")
    add("--signing-key", type=_key, metavar="FILE", help="the link's signing key: 32 octets, raw or hexadecimal")
    add("--parameter", type=_parameter, action="append", default=[], metavar="NAME=VALUE", help="set a parameter")
    add("--usb", action="store_true", help="the vehicle treats the link as USB")
    add("--release", type=_release, metavar="MAJOR.MINOR", help="the firmware release to report")
    add("--fault", type=_fault, action="append", default=[], metavar="KIND,at=TIME,...", help="repeatable")
    return options


def config_of(options: argparse.Namespace, utc_us: int = 0) -> SimulationConfig:
    """Return the configuration of the options; `utc_us` is the current time. Raise ValueError if they conflict."""
    speed, from_deg, *gust = options.wind
    home = HOME
    if options.home is not None:
        latitude, longitude, amsl = options.home
        home = HomePosition(round(latitude * 10_000_000), round(longitude * 10_000_000), round(amsl * 1000))
    return SimulationConfig(
        flavour=AutopilotKind(options.flavour),
        system=options.system,
        home=home,
        battery=round(options.battery * 100),
        other_batteries=tuple(options.other_battery),
        hover_us=round(options.hover * 60_000_000),
        cruise_mm_s=round(options.cruise * 1000),
        return_mm=round(options.return_at * 1000),
        wind=Wind(round(speed * 1000), round(from_deg), round(gust[0] * 1000) if gust else 0),
        seed=options.seed,
        noise=not options.no_noise,
        estimate=Estimate(options.estimate),
        answers=Answers(options.answers),
        boot=Boot(options.boot),
        extras=STOCK
        if options.stock
        else EQUIPPED
        if options.extra is None
        else frozenset(map(Equipment, options.extra)),
        camera=options.camera,
        gimbal=options.gimbal,
        parameters=tuple(options.parameter),
        faults=tuple(options.fault),
        signing_key=options.signing_key,
        usb=options.usb,
        release=options.release,
        utc_us=utc_us,
        speed=hundredths(options.speed),
    )


def _number(kind: type[int] | type[float], low: float, high: float) -> Callable[[str], float]:
    def parse(text: str) -> float:
        try:
            value = kind(text)
        except ValueError:
            value = kind(low) - 1
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"`{text}` is not a number from {low} to {high}")
        return value

    return parse


def _other_battery(text: str) -> OtherBattery:
    purpose, _, rest = text.partition(",")
    level, _, every = rest.partition(",")
    if purpose not in set(Purpose):
        raise argparse.ArgumentTypeError(f"no such purpose: `{purpose}`; expected one of {', '.join(Purpose)}")
    percent, seconds = _number(float, 0, 100)(level), _number(float, 0, 3_600)(every or "0")
    return OtherBattery(Purpose(purpose), round(percent * 100), round(seconds * 1_000_000))


def _listed(shape: str, least: int, most: int) -> Callable[[str], list[float]]:
    def parse(text: str) -> list[float]:
        try:
            values = [float(part) for part in text.split(",")]
        except ValueError:
            values = []
        if not least <= len(values) <= most or not all(abs(value) < 1e6 for value in values):
            raise argparse.ArgumentTypeError(f"`{text}` is not {shape}")
        return values

    return parse


def _release(text: str) -> tuple[int, int]:
    major, _, minor = text.partition(".")
    if not (text.isascii() and major.isdigit() and minor.isdigit()):
        raise argparse.ArgumentTypeError(f"`{text}` is not a release such as 1.18")
    return int(major), int(minor)


def _key(text: str) -> bytes:
    try:
        data = Path(text).read_bytes()
    except OSError as error:
        raise argparse.ArgumentTypeError(f"cannot read `{text}`: {(error.strerror or str(error)).lower()}") from None
    if len(data) != KEY_OCTETS:
        try:
            data = bytes.fromhex(data.decode("ascii"))
        except ValueError:
            data = b""
    if len(data) != KEY_OCTETS:
        raise argparse.ArgumentTypeError(f"`{text}` does not hold a key of {KEY_OCTETS} octets")
    return data


def _parameter(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError:
        raise argparse.ArgumentTypeError(f"`{text}` is not NAME=VALUE with a number") from None


def _fault(text: str) -> object:
    try:
        return parse_fault(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


EXIT_OK = 0
EXIT_USAGE = 2
"""An invalid option, as of argparse."""
EXIT_PORT = 3
"""The port is not available."""

_LEAP_US = 250_000
"""The most that the simulation catches up at once: a stopped process loses the time."""
HEARD = b"heard "
"""The prefix of a line with the time since boot, in us, of the last received position."""
_SHORTEST_SLEEP_S, _LONGEST_SLEEP_S = 0.001, 0.05
_LARGEST_DATAGRAM = 65_535


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the simulated vehicle until it is stopped; return the exit code."""
    options = parser().parse_args(arguments)
    try:
        config = config_of(options, time.time_ns() // 1000)
        simulation = Simulation(config)
    except ValueError as error:
        sys.stderr.write(f"error: {error}\n")
        return EXIT_USAGE
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        try:
            link.bind(("127.0.0.1", options.bind))
        except OSError as error:
            sys.stderr.write(f"error: cannot bind UDP port {options.bind}: {os.strerror(error.errno or 0).lower()}\n")
            return EXIT_PORT
        link.setblocking(False)
        ready = {
            "event": "ready",
            "flavour": config.flavour,
            "system": config.system,
            "local": link.getsockname()[1],
            "peer": options.port,
            "speed": options.speed,
            "pid": os.getpid(),
        }
        loop = _Loop(simulation, link, ("127.0.0.1", options.port), options.speed)
        with selectors.DefaultSelector() as selector:
            loop.listen(selector)
            sys.stdout.write(json.dumps(ready) + "\n")
            sys.stdout.flush()
            loop.follow(selector)
    return EXIT_OK


class Pace:
    """Pauses simulated time while the parent is behind. At high speed a busy parent would otherwise fall behind for
    good and act on old positions. The parent reports what it has received; without reports there is no pause.
    """

    #: how far sent positions may be ahead of received ones, us; and how long a report is valid, s of real time
    AHEAD_US: Final = 1_000_000
    PATIENCE_S: Final = 0.5
    _POSITION: Final = (33).to_bytes(3, "little")  # GLOBAL_POSITION_INT begins with the time since boot, in ms

    def __init__(self) -> None:
        self._said_us = self._heard_us = 0
        self._told_s: float | None = None

    def says(self, frame: bytes) -> None:
        """Record a frame that is sent."""
        if frame[7:10] == self._POSITION:
            self._said_us = int.from_bytes(frame[10 : 10 + min(4, frame[1])], "little") * 1_000

    def hears(self, boot_us: int, at_s: float) -> None:
        """Record the parent's report of a received position."""
        self._heard_us, self._told_s = boot_us, at_s

    def waits(self, at_s: float) -> bool:
        """Return whether simulated time is paused now."""
        if self._told_s is None or at_s - self._told_s > self.PATIENCE_S:
            return False
        return self._said_us - self._heard_us > self.AHEAD_US


class _Loop:
    def __init__(self, simulation: Simulation, link: socket.socket, peer: tuple[str, int], speed: float) -> None:
        self._simulation = simulation
        self._link = link
        self._peer = peer
        self._speed = speed
        self._ended = False
        self._unread = b""
        self._pace = Pace()

    def listen(self, selector: selectors.BaseSelector) -> None:
        """Listen to the peer, signals and standard input."""
        selector.register(self._link, selectors.EVENT_READ)
        signal.signal(signal.SIGTERM, self._end)
        if _stdin_is_a_pipe():
            selector.register(sys.stdin, selectors.EVENT_READ)
            # Ctrl-C reaches the whole process group; the vehicle must fly on while its parent brings it home.
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        else:
            signal.signal(signal.SIGINT, self._end)

    def follow(self, selector: selectors.BaseSelector) -> None:
        """Let the simulation follow real time until it is stopped."""
        sleep = min(max(TICK_US / 1_000_000 / self._speed, _SHORTEST_SLEEP_S), _LONGEST_SLEEP_S)
        last, now_us = time.monotonic(), 0.0
        while not self._ended:
            ready = [key.fileobj for key, _ in selector.select(self._until_next(sleep, now_us))]
            now = time.monotonic()
            if not self._pace.waits(now):
                now_us += min((now - last) * self._speed * 1_000_000, _LEAP_US)
            last = now
            if sys.stdin in ready and not self._told(os.read(sys.stdin.fileno(), 4096), int(now_us)):
                return
            if self._link in ready:
                self._hear(int(now_us))
            self._send(self._simulation.advance(int(now_us)))

    def _until_next(self, sleep: float, now_us: float) -> float:
        """Return how long to sleep; less if the vehicle answers before."""
        next_us = self._simulation.next_us
        if next_us is None:
            return sleep
        return min(sleep, max(_SHORTEST_SLEEP_S, (next_us - now_us) / 1_000_000 / self._speed))

    def _hear(self, at_us: int) -> None:
        while True:
            try:
                data, sender = self._link.recvfrom(_LARGEST_DATAGRAM)
            except BlockingIOError:
                return
            if sender == self._peer:
                self._send(self._simulation.receive(data, at_us))

    def _told(self, data: bytes, at_us: int) -> bool:
        """Process input from the parent; return whether standard input is still open."""
        *lines, self._unread = (self._unread + data).split(b"\n")
        for line in lines:
            if line.startswith(HEARD) and line[len(HEARD) :].isdigit():
                self._pace.hears(int(line[len(HEARD) :]), time.monotonic())
                continue
            try:
                fault = parse_fault(line.decode("ascii", "replace"))
            except ValueError as error:
                sys.stderr.write(f"error: {error}\n")
                continue
            self._simulation.inject(replace(fault, at_us=at_us + fault.at_us))
        return bool(data)

    def _send(self, frames: list[bytes]) -> None:
        for frame in frames:
            self._pace.says(frame)
            try:
                self._link.sendto(frame, self._peer)
            except BlockingIOError:
                return  # the send buffer is full: the remaining frames are lost, as on a radio

    def _end(self, *_: object) -> None:
        self._ended = True


def _stdin_is_a_pipe() -> bool:
    try:
        mode = os.fstat(sys.stdin.fileno()).st_mode
    except (AttributeError, OSError, ValueError):
        return False
    return stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode)
