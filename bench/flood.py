"""A flood of the agent socket: how much it delays the vehicle's frames.

A process sends a frame every 20 ms; the flight thread receives each through the driver and polls the agent socket in
between, as a run does. In turns there is no submission, or another process submits documents that are slow to decode,
verify or hash, as fast as they are read, with and without a mission key. The worst gap between two frames in a block
counts, and the median of the blocks. Exits with 1 when a flood makes it longer than `LIMIT` allows.

Then a replacement with few steps, and one with the greatest number of steps, is accepted: how long the flight thread is
blocked.
"""

import json
import multiprocessing
import os
import socket
import sys
import threading
import time
from base64 import b64encode
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from multiprocessing.synchronize import Event as Switch
from pathlib import Path
from select import select
from statistics import median
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from hostile.documents import hostile
from hostile.target import Target, greeting
from reference.documents import large, low, low_mission, replacement
from reference.world import MISSION_KEY, ROOT, ROOT_KEY, START, VEHICLE, Run, loaded, sealed_again
from rtshcua.adapters.boundary.process import BoundaryProcess
from rtshcua.app.fly.agents import Agents
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.isolated import Caller
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load
from rtshcua.wire.document import MAX_DOCUMENT

LIMIT = 1.2
BLOCKS, BLOCK_S = 7, 3.0
EVERY_S = 0.02
#: the number of steps of accepted replacements, less one; and of repetitions
STEPS, TRIES = (4, 20, 100, 700), 5
PIN = ROOT_KEY.verification().public
_OURS: list[socket.socket] = []


def ends_with_us() -> socket.socket:
    """A socket for child processes that becomes readable as soon as this process ends for any reason."""
    ours, theirs = socket.socketpair()
    _OURS.append(ours)
    return theirs


def end_with_parent(parent: socket.socket) -> None:
    """In a child: end with the parent. The child must close its copies of the parent's end to notice."""
    for each in _OURS:
        each.close()

    def wait() -> None:
        parent.recv(1)
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def send(port: int, frames: list[bytes], parent: socket.socket) -> None:
    """Send a frame every 20 ms, until it is ended."""
    end_with_parent(parent)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        begun, number = time.monotonic(), 0
        while True:
            number += 1
            time.sleep(max(0.0, begun + number * EVERY_S - time.monotonic()))
            link.sendto(frames[number % len(frames)], ("127.0.0.1", port))


def flood(path: str, documents: list[bytes], switch: Switch, parent: socket.socket) -> None:
    """Submit documents as fast as they are read, while the switch is on."""
    end_with_parent(parent)
    lines = [json.dumps({"id": 1, "document": b64encode(each).decode()}).encode() + b"\n" for each in documents]
    while True:
        switch.wait()
        with suppress(OSError), socket.socket(socket.AF_UNIX) as link:
            link.connect(path)
            link.setblocking(False)
            for line in lines:
                rest = memoryview(line)
                while rest and switch.is_set():
                    readable, writable, _ = select([link], [link], [], 0.1)
                    if readable and not link.recv(1 << 20):
                        break
                    if writable:
                        with suppress(BlockingIOError):
                            rest = rest[link.send(rest) :]


class Flight:
    """The work of a run in each turn of its loop that a flood affects: frames, sockets, the runtime's step."""

    def __init__(self, of: Loaded, folder: Path) -> None:
        self.run = Run(of, ready=False)
        self.agents = Agents(folder / "s", of)
        self.driver = Target("px4", keyed=False)
        self.frames = [self.driver.says(each) for each in greeting("px4")]
        self.link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.link.bind(("127.0.0.1", 0))
        self.begun_us = time.monotonic_ns() // 1000
        self.handed_in = 0

    def now(self) -> Now:
        """The flight's time, from the receipt of the bundle."""
        passed_us = time.monotonic_ns() // 1000 - self.begun_us
        return Now(START.monotonic_us + passed_us, START.utc_us + passed_us, START.utc_error_us)

    def worst_gap_s(self, lasts_s: float) -> float:
        """Return the longest time between two received frames."""
        until_s, last_s, worst_s = time.monotonic() + lasts_s, 0.0, 0.0
        while last_s < until_s:
            if select([self.link], [], [], 0.05)[0]:
                self.driver.receive(self.link.recv(2048))
                taken_s = time.monotonic()
                worst_s, last_s = max(worst_s, taken_s - last_s if last_s else 0.0), taken_s
            now = self.now()
            events = self.agents.events(now)
            self.handed_in += len(events)
            self.agents.watch(self.run.runtime.step(now, events))
        return worst_s

    def close(self) -> None:
        """Stop listening."""
        self.agents.__exit__(None, None, None)
        self.link.close()


def measured(name: str, of: Loaded, folder: Path) -> float:
    """Print the gaps of a mode; return the flood's gap relative to the quiet one."""
    flight = Flight(of, folder)
    documents = [document for document, _ in hostile(MISSION_KEY).values()] + [replacement(of)] * 2
    assert max(map(len, documents)) <= MAX_DOCUMENT
    start = multiprocessing.get_context("fork")
    switch, parent = start.Event(), ends_with_us()
    others = [
        start.Process(target=send, args=(flight.link.getsockname()[1], flight.frames, parent), daemon=True),
        start.Process(target=flood, args=(str(folder / "s"), documents, switch, parent), daemon=True),
    ]
    for each in others:
        each.start()
    try:
        flight.worst_gap_s(2.0)
        gaps: tuple[list[float], list[float]] = ([], [])
        for _ in range(BLOCKS):
            for flooded, of_kind in enumerate(gaps):
                (switch.set if flooded else switch.clear)()
                of_kind.append(flight.worst_gap_s(BLOCK_S))
        assert flight.handed_in, "nothing was handed in"
    finally:
        for each in others:
            each.kill()
            each.join()
        parent.close()
        _OURS.pop().close()
        flight.close()
    quiet, flooded_s = map(median, gaps)
    ratio = flooded_s / quiet
    told = "held  " if ratio <= LIMIT else "MISSED"
    print(
        f"{told}  flood, {name}: worst gap {flooded_s * 1e3:.1f} ms between frames, "
        f"quiet {quiet * 1e3:.1f} ms, ratio {ratio:.2f}, limit {LIMIT} ({flight.handed_in} documents taken up)"
    )
    return ratio


@contextmanager
def in_process(folder: Path) -> Iterator[Loaded]:
    """Return the same flight with a boundary process."""
    process = BoundaryProcess(ROOT.sign(ROOT_KEY), PIN, VEHICLE, folder, paced=True)
    try:
        of = load(
            sealed_again(loaded(mission=low_mission())), root=ROOT, vehicle=VEHICLE, now=START,
            mode=EnforcementMode.PROCESS,
            session_key=bytes(32), flight=bytes(16), peer_is_own_simulator=False, caller=Caller(process.call),
        )  # fmt: skip
        assert isinstance(of, Loaded), of
        yield of
    finally:
        process.close()


def stood_ms(of: Loaded, steps: int, folder: Path) -> float:
    """Return the longest turn of the flight thread while a replacement of so many steps is accepted."""
    flight = Flight(of, folder)
    line = json.dumps({"id": 1, "document": b64encode(large(of, steps)).decode()}).encode() + b"\n"
    sender = socket.socket(socket.AF_UNIX)
    sender.connect(str(folder / "s"))
    thread = threading.Thread(target=sender.sendall, args=(line,))
    thread.start()
    worst_s, until_s = 0.0, time.monotonic() + 30.0
    try:
        while len(of.bundle.mission.invocations) != steps + 1:
            assert time.monotonic() < until_s, "it is not accepted"
            time.sleep(0.002)
            begun_s, now = time.perf_counter(), flight.now()
            events = flight.agents.events(now)
            flight.agents.watch(flight.run.runtime.step(now, events) if events else ())
            worst_s = max(worst_s, time.perf_counter() - begun_s)
    finally:
        thread.join()
        sender.close()
        flight.close()
    return worst_s * 1e3


def accepted() -> None:
    """Print the time that an accepted replacement blocks the flight thread, the best of several."""
    flown: dict[str, Callable[[Path], AbstractContextManager[Loaded]]] = {
        "software": lambda _: nullcontext(low()),
        "process": in_process,
    }
    for mode in flown:
        told = []
        for steps in STEPS:
            found = []
            for _ in range(TRIES):
                with TemporaryDirectory(dir="/tmp") as name, flown[mode](Path(name)) as of:
                    found.append(stood_ms(of, steps, Path(name)))
            told.append(f"{steps + 1} steps {min(found):.1f} ms")
        print(f"        accepted, {mode}: {', '.join(told)} in one turn")


def main() -> int:
    """Measure both modes and print; return 1 if the limit is missed."""
    with TemporaryDirectory(dir="/tmp") as one, TemporaryDirectory(dir="/tmp") as other:
        worst = measured("software", low(), Path(one))
        with in_process(Path(other)) as of:
            worst = max(worst, measured("process", of, Path(other)))
    accepted()
    return int(worst > LIMIT)


if __name__ == "__main__":
    sys.exit(main())
