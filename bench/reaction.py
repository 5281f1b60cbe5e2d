"""Reaction: from a telemetry frame that violates a limit to the frame of the fallback's command, over UDP on loopback.

A process flies a mission in virtual time into its second step, and from there in real time, like `rtshcua run`: it
receives 200 frames a second, until one reports a low battery. The peer, another process, time-stamps that frame and the
answers. The fallback is a return, which sets a mode: so the first answer requests the vehicle's mode, and the command
follows after the report (docs/adr/0034). The peer reports at once, so the autopilot's own delay is not included; a peer
without reports shows the bound. Meanwhile each write of evidence and telemetry takes 20 ms and each sync 200 ms
(injected at the files), and the terminal is not read. The same is measured with a fast disk and no view. Exits with 1
when a figure is above its limit.

Because of noise, percentiles are those of the quietest process; the median process is printed too.
"""

import gc
import os
import select
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from random import Random
from statistics import median
from typing import Any, cast

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.loop import RunLoop
from rtshcua.adapters.store.evidence_file import EvidenceFile, EvidenceWriter, LogFile
from rtshcua.adapters.store.telemetry import TelemetryFile
from rtshcua.adapters.vehicle.connected import ConnectedVehicle
from rtshcua.adapters.vehicle.transport import UdpTransport
from rtshcua.app.fly.narrator import Teller, Watching
from rtshcua.app.fly.story import Note
from rtshcua.codec.frames import Codec
from rtshcua.front.cli.render.live.feed import Feed
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.runtime.view import RunStage
from virtual.flight import Flight
from virtual.shipped import shipped, simulated

PROCESSES, IN_PROCESS, QUICK = 3, 100, 40
RATE = 200
FRAMES = 40  # frames before the violating one
WRITE_S, SYNC_S = 0.02, 0.2
MEDIAN_LIMIT_US, P99_LIMIT_US = 500.0, 2_000.0
#: to the command: its own time, and the mode request
COMMAND_MEDIAN_LIMIT_US, COMMAND_P99_LIMIT_US = 1_000.0, 4_000.0
#: without an answer to the mode request
MUTE, MUTE_LIMIT_US = 10, 60_000.0
PATIENCE_S = 2.0
STEP = 1
ECHO = """
import select, socket
link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
link.bind(("127.0.0.1", 0))
print(link.getsockname()[1], flush=True)
while True:
    select.select([link], [], [])
    link.sendto(*link.recvfrom(1024))
"""
SET_INTERVAL, REQUEST = 511, 512  # of MAV_CMD
HEARTBEAT = 0


class SlowFile(EvidenceFile):
    """An evidence file on a slow disk."""

    def append(self, line: bytes, durability: int) -> None:
        """Takes its time."""
        time.sleep(WRITE_S)
        super().append(line, durability)

    def sync(self) -> None:
        """Takes much more."""
        time.sleep(SYNC_S)
        super().sync()


class Slowly:
    """A telemetry log's file on a slow disk."""

    def __init__(self, file: Any) -> None:
        self._file = file

    def write(self, data: bytes) -> int:
        """Takes its time, as if each batch were synced."""
        time.sleep(WRITE_S + SYNC_S)
        return int(self._file.write(data))

    def sync(self) -> None:
        """Takes much more."""
        time.sleep(SYNC_S)
        self._file.sync()


class Going:
    """A flight's clock that continues in real time."""

    def __init__(self, since: Now) -> None:
        self._since = since
        self._start_ns = time.monotonic_ns()

    def now(self) -> Now:
        """Return the current time."""
        gone_us = (time.monotonic_ns() - self._start_ns) // 1_000
        return Now(self._since.monotonic_us + gone_us, self._since.utc_us + gone_us, self._since.utc_error_us)

    def heard(self, boot_us: int) -> None:
        """Nothing."""

    def tell(self, whom: Callable[[int], object]) -> None:
        """Nothing."""

    def real_seconds(self, us: int) -> float:
        """Seconds."""
        return us / 1e6

    def us_in(self, seconds: float) -> int:
        """Microseconds."""
        return int(seconds * 1e6)

    def bound_utc(self, error_us: int, ahead_us: int | None = None) -> None:
        """The flight's stays as it is."""


def under_way() -> Flight:
    """Return a flight in its second step."""
    flight = Flight(shipped("short"), simulated("px4"))
    while True:
        assert flight.loop.turn() is None
        view = flight.runtime.view(flight.clock.now())
        if view.stage is RunStage.RUNNING and view.step == STEP:
            return flight


def telemetry(flight: Flight) -> list[bytes]:
    """Return the next frames of the vehicle, the violating frame, and the mode report."""
    frames: list[bytes] = []
    simulation, elapsed_us = flight.vehicle.simulation, flight.clock.elapsed_us
    while len(frames) < FRAMES:
        elapsed_us += 20_000
        frames += simulation.advance(elapsed_us)
    low = mavlink.MAVLink_battery_status_message(0, 0, 0, 32_767, [65_535] * 10, -1, 0, 0, 20)
    codec, after = Codec(1, 1), (frames[FRAMES - 1][4] + 1) % 256
    for _ in range(after):  # frames must be numbered in the order of sending, or they count as old
        codec.pack(low)
    broken = codec.pack(low)
    seen = flight.vehicle.driver.seen
    beat = mavlink.MAVLink_heartbeat_message(2, 12, 128, seen.mode, 4, 3)
    return [*frames[:FRAMES], broken, codec.pack(beat)]


@contextmanager
def blocked() -> Iterator[Feed]:
    """A view with an unread terminal: its pipe is full, and so is the pipe to it."""
    reading, writing = os.pipe()
    stdout = os.dup(1)
    os.dup2(writing, 1)
    feed = Feed("lines")
    os.dup2(stdout, 1)
    while len(feed._waiting) < 10:
        feed.post(Note("nobody reads this " * 20))
    try:
        yield feed
    finally:
        feed._process.kill()
        feed._process.wait()
        for handle in (reading, writing, stdout):
            os.close(handle)


def unwatched(*_: Any) -> None:
    """Run without a view."""


def fly_on(flight: Flight, feed: Feed | None, folder: Path) -> None:
    """Continue the flight in real time until the peer has its answer."""
    clock = Going(flight.clock.now())
    frames = TelemetryFile(folder / "telemetry.tlog")
    if feed is not None:
        frames._file = cast(LogFile, Slowly(frames._file))
    sink = EvidenceWriter((SlowFile if feed else EvidenceFile)(folder / "log.jsonl"))
    transport = UdpTransport("127.0.0.1", 0, begins=False)
    vehicle = ConnectedVehicle(transport, flight.vehicle.driver, clock, frames.write)
    watch: Callable[..., None] = unwatched
    if feed is not None:
        policy, mission = flight.loaded.bundle.policy, flight.loaded.bundle.mission
        teller = Teller(policy, mission, clock.now().monotonic_us)
        watch = Watching(feed, teller, flight.runtime.view, lambda: vehicle.driver.unready, live=True)
    loop = RunLoop(flight.runtime, vehicle, sink, clock, watch)
    gc.collect()
    gc.freeze()  # as `rtshcua run` does
    print(transport.port, flush=True)
    while not select.select([sys.stdin], [], [], 0)[0]:
        loop.turn()
    sys.stdin.readline()
    vehicle.close()
    gc.unfreeze()


def fly(*, slowly: bool) -> None:
    """Fly in a child process, one flight after the other, until the peer ends."""
    with blocked() if slowly else nullcontext() as feed, tempfile.TemporaryDirectory() as folder:
        number = 0
        while sys.stdin.readline():
            place = Path(folder) / str(number)
            place.mkdir()
            fly_on(under_way(), feed, place)
            number += 1


Took = tuple[float, float]
"""The time to the first answer and to the command, us."""


def reactions(
    frames: list[bytes], chance: Random, *, slowly: bool, count: int, processes: int = 1, tells: bool = True
) -> list[list[Took]]:
    """Return the reactions of several processes, in order."""
    found = []
    for _ in range(processes):
        words = [sys.executable, __file__, "--fly", "slowly" if slowly else "quickly"]
        with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as flying:
            found.append([one(flying, frames, chance, tells=tells) for _ in range(count)])
            if flying.stdin is not None:
                flying.stdin.close()
            flying.kill()  # its files are slow
    return found


def one(flying: Any, frames: list[bytes], chance: Random, *, tells: bool) -> Took:
    """Measure one reaction of the process."""
    flying.stdin.write(b"\n")
    flying.stdin.flush()
    port = int(flying.stdout.readline())
    took = react(("127.0.0.1", port), frames, chance, tells=tells)
    flying.stdin.write(b"\n")
    flying.stdin.flush()
    return took


def react(address: tuple[str, int], frames: list[bytes], chance: Random, *, tells: bool) -> Took:
    """Send the frames at their rate, and measure the reaction to the last but one. `tells`: send the last one, the mode
    report, whenever it is requested.
    """
    *before, broken, mode = frames
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        start_s = time.monotonic()
        for number, frame in enumerate(before):
            link.sendto(frame, address)
            time.sleep(max(0.0, start_s + (number + 1) / RATE - time.monotonic()))
        time.sleep(chance.random() / RATE)
        link.setblocking(False)
        with suppress(BlockingIOError):
            while link.recv(1024):
                pass
        link.settimeout(PATIENCE_S)
        sent_ns, first_us = time.monotonic_ns(), None
        link.sendto(broken, address)
        while True:
            answer = link.recv(1024)
            had_us = (time.monotonic_ns() - sent_ns) / 1e3
            for received in Codec(1, 1).parse(answer):
                if not received.name.startswith("COMMAND_") or received.message.command == SET_INTERVAL:
                    continue
                if received.message.command != REQUEST:
                    return first_us or had_us, had_us
                if received.message.param1 == HEARTBEAT:
                    first_us = first_us or had_us
                    if tells:
                        link.sendto(mode, address)


def bare(count: int) -> list[float]:
    """Return the round trip time to an echo process, in us."""
    words = [sys.executable, "-c", ECHO]
    with (
        subprocess.Popen(words, stdout=subprocess.PIPE) as echo,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link,
    ):
        assert echo.stdout is not None
        address, times = ("127.0.0.1", int(echo.stdout.readline())), []
        link.settimeout(PATIENCE_S)
        for _ in range(count):
            time.sleep(1 / RATE)
            sent_ns = time.monotonic_ns()
            link.sendto(bytes(50), address)
            link.recv(1024)
            times.append((time.monotonic_ns() - sent_ns) / 1e3)
        echo.kill()
    return times


def high(times: list[float]) -> float:
    """Return the 99th percentile."""
    return sorted(times)[-(-len(times) * 99 // 100) - 1]


def main() -> int:
    """Measure and print; return 1 if a limit is missed."""
    if sys.argv[1:2] == ["--fly"]:
        fly(slowly=sys.argv[2] == "slowly")
        return 0
    frames, chance = telemetry(under_way()), Random(1)
    gc.disable()
    slow = reactions(frames, chance, slowly=True, count=IN_PROCESS, processes=PROCESSES)
    (quick,) = reactions(frames, chance, slowly=False, count=QUICK)
    ((*mute,),) = reactions(frames, chance, slowly=False, count=MUTE, tells=False)
    held = [
        told("telemetry frame in to the question who flies", [[first for first, _ in each] for each in slow],
             MEDIAN_LIMIT_US, P99_LIMIT_US),
        told("telemetry frame in to the way home, told the mode at once", [[last for _, last in each] for each in slow],
             COMMAND_MEDIAN_LIMIT_US, COMMAND_P99_LIMIT_US),
    ]  # fmt: skip
    middle, plain = (min(median(last for _, last in each) for each in runs) for runs in (slow, [quick]))
    print(
        f"reaction: with a quick disk and no view: median {plain:.0f} us, p99 {high([last for _, last in quick]):.0f} "
        f"us; the slow disk and the terminal make it {middle / plain:.2f} times"
    )
    longest = max(last for _, last in mute)
    print(f"reaction: told no mode at all, the way home leaves after {longest:.0f} us (limit {MUTE_LIMIT_US:.0f})")
    echo = bare(IN_PROCESS)
    print(
        f"reaction: a process that only sends back what comes: median {median(echo):.0f} us, p99 {high(echo):.0f} us; "
        f"ours takes {middle / median(echo):.1f} times that"
    )
    return int(not all(held) or longest > MUTE_LIMIT_US)


def told(what: str, runs: list[list[float]], middle_limit: float, worst_limit: float) -> bool:
    """Print a row; return whether its limits hold."""
    middle, worst = min(map(median, runs)), min(map(high, runs))
    print(
        f"reaction: {what}, {RATE} frames a second, slow disk, blocked terminal: "
        f"median {middle:.0f} us (limit {middle_limit:.0f}), p99 {worst:.0f} us (limit {worst_limit:.0f}); median "
        f"process: {median(map(median, runs)):.0f} us, {median(map(high, runs)):.0f} us; "
        f"first of a process: {median(times[0] for times in runs):.0f} us"
    )
    return middle <= middle_limit and worst <= worst_limit


if __name__ == "__main__":
    sys.exit(main())
