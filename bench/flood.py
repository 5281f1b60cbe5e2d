"""Whoever floods the agent socket: how much later are the frames of the vehicle taken in?

A process sends a frame every 20 ms, and the thread that flies takes each in, by the driver, and looks at the agent
socket in between, as a run does. In turns nobody hands anything in, and another process hands in whatever takes long to
decode, verify or hash, as fast as it is read, with a mission key and without. Of each the worst gap between two frames
in a block counts, and of the blocks the median. Exits with 1 where a flood makes it longer than `LIMIT` allows.

Then a replacement is accepted, of few steps and of as many as a document holds: how long the thread that flies stood.
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
from rtshcua.adapters.boundary_process import BoundaryProcess
from rtshcua.app.fly.agents import Agents
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.isolated import Caller
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load
from rtshcua.wire.document import MAX_DOCUMENT

LIMIT = 1.2
BLOCKS, BLOCK_S = 7, 3.0
EVERY_S = 0.02
#: of replacements that are accepted, but for one; and how often each is tried
STEPS, TRIES = (4, 20, 100, 700), 5
PIN = ROOT_KEY.verification().public
_OURS: list[socket.socket] = []


def ends_with_us() -> socket.socket:
    """In this process, a socket for its children: it can be read as soon as this process is gone, however it went."""
    ours, theirs = socket.socketpair()
    _OURS.append(ours)
    return theirs


def end_with_parent(parent: socket.socket) -> None:
    """In a child: end when the parent is gone. It drops its copies of the parent's end, or it would never see."""
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
    """Hand documents in as fast as they are read, while the switch is on."""
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
    """What a run does in each turn of its loop, with what a flood reaches: frames, sockets, the runtime's step."""

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
        """The flight's time: it began as the bundle was received."""
        passed_us = time.monotonic_ns() // 1000 - self.begun_us
        return Now(START.monotonic_us + passed_us, START.utc_us + passed_us, START.utc_error_us)

    def worst_gap_s(self, lasts_s: float) -> float:
        """The longest time between two frames that were taken in."""
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
        """Listen no more."""
        self.agents.__exit__(None, None, None)
        self.link.close()


def measured(name: str, of: Loaded, folder: Path) -> float:
    """Print the gaps of a mode, and give how many times the quiet one that of a flood is."""
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
    """The same flight with the boundary in a process of its own."""
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
    """The longest turn of the thread that flies while a replacement of so many steps is handed in and accepted."""
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
    """Print how long an accepted replacement takes of the thread that flies, at best of some."""
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
    """Measures both modes, prints, and says whether the limit held."""
    with TemporaryDirectory(dir="/tmp") as one, TemporaryDirectory(dir="/tmp") as other:
        worst = measured("software", low(), Path(one))
        with in_process(Path(other)) as of:
            worst = max(worst, measured("process", of, Path(other)))
    accepted()
    return int(worst > LIMIT)


if __name__ == "__main__":
    sys.exit(main())
