"""The gateway's relay beside other routers: added latency and greatest throughput without loss; and the time in which
the whole gateway refuses.

One process plays the vehicle and four clients; the router is another process. Beside the gateway run a bare UDP relay
in Python, MAVProxy as a router (`--out`, without modules), and mavlink-router where `mavlink-routerd` is on the PATH.
The gateway also serves FLIGHT and the copy for its starter.

- Latency: from the vehicle's call to the kernel's time of arrival at a client, at `RATE` frames a second. In `BLOCKS`
  turns each router gets `FRAMES`; the gateway's median less the bare relay's is what it adds. No frame may be lost.
- Throughput: the greatest rate at which every frame of a burst of `BURST_S` reaches all clients (and FLIGHT) within
  `LATE_S` of the last one. The best of `TRIES` counts at each rate, and the median of `ROUNDS` searches.
- Refusal: from a client's frame to the answer, through `rtshcua gateway` with all its processes, its policy and a
  simulated PX4: `REFUSALS` requests of each kind, no two of them alike, one every `PACE_S`.

Exits with 1 when a limit is missed.
"""

import os
import shutil
import signal
import socket
import struct
import subprocess
import sys
import sysconfig
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from math import nan
from pathlib import Path
from select import select
from statistics import median
from tempfile import TemporaryDirectory
from typing import NamedTuple

from rtshcua.adapters.gateway.messages import ClientSetup, RelayKind, encoded
from rtshcua.adapters.gateway.process import RelayProcess
from rtshcua.codec.frames import kind_of
from rtshcua.ground.gateway.client_frames import made, received
from rtshcua.mavlink import layouts
from rtshcua.mavlink.command_results import DENIED
from rtshcua.mavlink.framing import HEAD, HEADER, MARKER, frames_in, octets_of_checksum

CLIENTS = 4
#: what the gateway may add to the bare relay at the median, in ms, and what it may take to refuse
ADDED_MS, REFUSAL_MS = 0.5, 2.0
#: how many times MAVProxy's throughput it must have, and mavlink-router's
OF_MAVPROXY, OF_ROUTER = 5.0, 0.5
RATE, FRAMES, BLOCKS = 1_000, 2_000, 5
BURST_S, LATE_S, TRIES, ROUNDS = 1.0, 0.05, 3, 3
#: the rates between which the greatest is searched, and how exactly
LEAST, MOST, EXACT = 250, 200_000, 1.05
#: the requests of each kind, and their interval: a client's commands are decided up to 20 times a second
REFUSALS, PACE_S = 200, 0.07
PATIENCE_S = 20.0
#: what `rtshcua gateway` permits: a field of 240 m by 220 m around the simulated vehicle's home
RULES = ("--allow", "takeoff,goto,land", "--below", "30", "m", "--inside", "field.kml")
KML = """<kml xmlns="http://www.opengis.net/kml/2.2"><Placemark><name>field</name><Polygon><outerBoundaryIs><LinearRing>
<coordinates>8.5440,47.3967,0 8.5470,47.3967,0 8.5470,47.3987,0 8.5440,47.3987,0 8.5440,47.3967,0</coordinates>
</LinearRing></outerBoundaryIs></Polygon></Placemark></kml>
"""
TAKEOFF, REPOSITION, UNSET = 22, 192, 2**31 - 1
#: MAV_FRAME_GLOBAL, MAV_FRAME_GLOBAL_RELATIVE_ALT
ABOVE_SEA, ABOVE_HOME = 0, 3
_HERE = "127.0.0.1"
_HEARTBEAT, _IMU = 0, 105
#: HIGHRES_IMU of the vehicle, in a frame's header: system, component, message
_MARK = bytes((1, 1, _IMU, 0, 0))
_BUFFER = 4 << 20
_TIME = struct.Struct("<Q")
_STAMP = struct.Struct("qq")
_SO_TIMESTAMPNS = 35


def frame(number: int, payload: bytes, sequence: int, system: int = 1, component: int = 1) -> bytes:
    """A frame of MAVLink 2."""
    kind = kind_of(number)
    assert kind is not None
    head = HEAD.pack(MARKER, len(payload), 0, 0, sequence & 0xFF, system, component, number, 0)
    return head + payload + octets_of_checksum(head[1:] + payload + kind.extra)


def imu(time_ns: int, sequence: int) -> bytes:
    """HIGHRES_IMU with a time in ns in place of `time_usec`: 74 octets."""
    return frame(_IMU, _TIME.pack(time_ns) + b"\x55" * 54, sequence)


def heartbeat(system: int = 1, component: int = 1) -> bytes:
    """HEARTBEAT."""
    return frame(_HEARTBEAT, struct.pack("<IBBBBB", 0, 2, 3, 0, 4, 3), 0, system, component)


def udp(port: int = 0) -> socket.socket:
    """A UDP socket on this machine."""
    link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
    link.bind((_HERE, port))
    link.setblocking(False)
    return link


def free_port() -> int:
    """A port that is free now."""
    with udp() as link:
        return int(link.getsockname()[1])


def drained(link: socket.socket) -> Iterator[bytes]:
    """The datagrams that wait at a socket."""
    with suppress(BlockingIOError):
        while True:
            yield link.recv(65_535)


class Bench:
    """A running router, its vehicle and its clients. `more`: sockets that must get every frame too; `others`: sockets
    that are read, and may lose frames.
    """

    def __init__(
        self, port: int, clients: Sequence[socket.socket], more: Sequence[socket.socket] = (),
        others: Sequence[socket.socket] = (),
    ) -> None:  # fmt: skip
        self.clients, self.more, self.others = clients, more, others
        self._vehicle = udp()
        self._vehicle.connect((_HERE, port))
        self._frames = [imu(number, number) for number in range(256)]
        for client in clients:
            client.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        self._await_router()

    def _await_router(self) -> None:
        until = time.monotonic() + PATIENCE_S
        missing = set(self.clients)
        while missing:
            assert time.monotonic() < until, "the router passes nothing on"
            with suppress(OSError):
                self._vehicle.send(heartbeat())
            time.sleep(0.05)
            missing -= {client for client in missing if any(drained(client))}
        self.settle()

    def settle(self) -> None:
        """Read what still comes."""
        until = time.monotonic() + 0.3
        while time.monotonic() < until:
            for link in (*self.clients, *self.more, *self.others, self._vehicle):
                for _ in drained(link):
                    until = time.monotonic() + 0.3
            time.sleep(0.01)

    def latencies(self, frames: int) -> tuple[list[int], int]:
        """The latencies at `RATE` in ns, and the number of lost frames."""
        self.settle()
        found: list[int] = []
        begun = time.monotonic()
        for number in range(frames):
            while (left := begun + number / RATE - time.monotonic()) > 0:
                time.sleep(left)
            self._vehicle.send(imu(time.time_ns(), number))
            if number % 10 == 0:
                self._stamped(found)
        time.sleep(0.3)
        self._stamped(found)
        return found, CLIENTS * frames - len(found)

    def _stamped(self, found: list[int]) -> None:
        for client in self.clients:
            with suppress(BlockingIOError):
                while True:
                    datagram, ancillary, _, _ = client.recvmsg(65_535, 64)
                    seconds, ns = _STAMP.unpack(ancillary[0][2])
                    start = datagram.find(_MARK)
                    while start >= 0:
                        sent = _TIME.unpack_from(datagram, start + len(_MARK))[0]
                        found.append(1_000_000_000 * seconds + ns - sent)
                        start = datagram.find(_MARK, start + HEADER)
        for link in (*self.more, *self.others):
            for _ in drained(link):
                pass

    def holds(self, rate: int) -> bool:
        """Whether a burst at this rate reaches everybody in time, in one of `TRIES`."""
        return any(self._burst(rate) for _ in range(TRIES))

    def _burst(self, rate: int) -> bool:
        self.settle()
        wanted, sent = round(rate * BURST_S), 0
        arrived = dict.fromkeys((*self.clients, *self.more), 0)
        begun = last = time.monotonic()
        frames, send = self._frames, self._vehicle.send
        while (now := time.monotonic()) < last + LATE_S and min(arrived.values()) < wanted:
            due = min(wanted, round(rate * (now - begun)))
            for number in range(sent, due):
                send(frames[number & 0xFF])
            if sent < due:
                sent, last = due, time.monotonic()
            for link in arrived:
                arrived[link] += sum(datagram.count(_MARK) for datagram in drained(link))
            for link in self.others:
                for _ in drained(link):
                    pass
        # a vehicle that is slower than its rate says nothing about the router
        return min(arrived.values()) == wanted and last - begun < 1.1 * BURST_S

    def throughput(self) -> int:
        """The greatest rate that holds, in frames a second; 0 if none does."""
        low, high = 0, LEAST
        while high <= MOST and self.holds(high):
            low, high = high, 2 * high
        while low and high / low > EXACT:
            middle = round((low * high) ** 0.5)
            low, high = (middle, high) if self.holds(middle) else (low, middle)
        return low

    def close(self) -> None:
        """Close the sockets."""
        for link in (*self.clients, *self.more, *self.others, self._vehicle):
            link.close()


# ---------------------------------------------------------------- the routers


@contextmanager
def started(words: Sequence[str], cwd: str | None = None) -> Iterator[None]:
    """A process, until the end of the block."""
    process = subprocess.Popen(
        words, cwd=cwd, env=os.environ | ({"HOME": cwd} if cwd else {}), stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        yield
    finally:
        process.terminate()
        try:
            process.wait(5)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def relay(port: int, clients: Sequence[int]) -> None:
    """The bare relay: every datagram of the vehicle to each client."""
    to = [(_HERE, client) for client in clients]
    with udp(port) as link:
        link.setblocking(True)
        while True:
            datagram = link.recv(65_535)
            for each in to:
                with suppress(OSError):
                    link.sendto(datagram, each)


@contextmanager
def bare() -> Iterator[Bench]:
    """The bare relay."""
    clients, port = [udp() for _ in range(CLIENTS)], free_port()
    with started([sys.executable, __file__, "--relay", str(port), *map(_port, clients)]):
        yield Bench(port, clients)


@contextmanager
def mavproxy() -> Iterator[Bench]:
    """MAVProxy without modules."""
    clients, port = [udp() for _ in range(CLIENTS)], free_port()
    words = [sys.executable, str(Path(sysconfig.get_path("scripts")) / "mavproxy.py"), "--daemon", "--no-state"]
    words += [f"--master=udpin:{_HERE}:{port}", "--default-modules=", "--streamrate=-1", "--dialect=ardupilotmega"]
    words += [f"--out=udpout:{_HERE}:{_port(client)}" for client in clients]
    with TemporaryDirectory() as folder, started(words, folder):
        yield Bench(port, clients)


@contextmanager
def mavlink_router() -> Iterator[Bench]:
    """mavlink-router, if it is installed."""
    clients, port = [udp() for _ in range(CLIENTS)], free_port()
    words = [shutil.which("mavlink-routerd") or "", "-t", "0"]
    for client in clients:
        words += ["-e", f"{_HERE}:{_port(client)}"]
    with started([*words, f"{_HERE}:{port}"]):
        yield Bench(port, clients)


@contextmanager
def gateway() -> Iterator[Bench]:
    """The gateway's relay, with a session of FLIGHT."""
    with ExitStack() as stack:
        process, clients, port = _gateway()
        stack.callback(process.close)
        flight = process.session()
        flight.setblocking(False)
        yield Bench(port, clients, [flight], [process.telemetry, process.control])


def _gateway() -> tuple[RelayProcess, list[socket.socket], int]:
    ports, port = [free_port() for _ in range(CLIENTS)], free_port()
    setups = [ClientSetup(f"client {each}", f"udpin:{_HERE}:{each}", rate=1_000) for each in ports]
    process = RelayProcess(f"udpin:{_HERE}:{port}", setups)
    process.control.send(encoded(RelayKind.VEHICLE, 0, bytes([1])))  # clients hear only a vehicle that is known
    clients = [udp() for _ in ports]
    for client, each in zip(clients, ports, strict=True):
        client.connect((_HERE, each))
        client.send(heartbeat(255, 190))
    return process, clients, port


def _port(link: socket.socket) -> str:
    return str(link.getsockname()[1])


# ---------------------------------------------------------------- a refusal


@contextmanager
def whole_gateway() -> Iterator[socket.socket]:
    """`rtshcua gateway` with its relay, its flight and a simulated PX4; a socket that is connected as its client."""
    port = free_port()
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "field.kml").write_text(KML)
        words = [sys.executable, "-m", "rtshcua", "gateway", *RULES, "--client", f"script=udpin:{_HERE}:{port}"]
        with (folder / "printed.txt").open("wb") as printed:
            process = subprocess.Popen(
                words, cwd=folder, env=os.environ | {"RTSHCUA_DATA_DIR": str(folder / "data")},
                stdin=subprocess.DEVNULL, stdout=printed, stderr=printed,
            )  # fmt: skip
            try:
                with udp() as link:
                    link.connect((_HERE, port))
                    yield link
            except AssertionError:
                print((folder / "printed.txt").read_text(), file=sys.stderr)
                raise
            finally:
                process.send_signal(signal.SIGINT)
                process.wait()


def too_high(number: int) -> tuple[int, bytes]:
    """A take-off above the limit, each one to another height, on PX4 above mean sea level."""
    return TAKEOFF, command(TAKEOFF, number, z=600.0 + number / 8)


def beyond(number: int) -> tuple[int, bytes]:
    """A go-to to a place outside of the field, each one to another place."""
    place = {"x": 473_978_000 + 10 * number, "y": 85_480_000 + 10 * number, "z": 10.0}
    return REPOSITION, command(REPOSITION, number, param1=-1.0, param2=1.0, **place)


def command(number: int, sequence: int, **values: float) -> bytes:
    """COMMAND_INT above home, with unset fields for those that are not given."""
    unset = {"param4": nan, "x": UNSET, "y": UNSET}
    target = {"target_system": 1, "target_component": 1, "frame": ABOVE_HOME if number == REPOSITION else ABOVE_SEA}
    return made(layouts.COMMAND_INT, unset | target | {"command": number} | values, (255, 190), sequence)


def result(link: socket.socket, number: int, patience_s: float = PATIENCE_S) -> int | None:
    """The result of a command; None if none came in time."""
    until = time.monotonic() + patience_s
    while (left := until - time.monotonic()) > 0 and select([link], [], [], left)[0]:
        for each in frames_in(link.recv(65_535)):
            message = received(each)
            if message is not None and message.message == layouts.COMMAND_ACK and message.fields["command"] == number:
                return int(message.fields["result"])
    return None


def refusals(link: socket.socket, request: Callable[[int], tuple[int, bytes]]) -> list[float]:
    """The times from a client's commands, each of them refused for good, to the answers, in ms."""
    until = time.monotonic() + PATIENCE_S
    number, asked = request(REFUSALS)
    while True:  # until the vehicle's position and the height of its home are known
        with suppress(OSError):
            link.send(heartbeat(255, 190))
            link.send(asked)
            if result(link, number, 1.0) == DENIED:
                break
        assert time.monotonic() < until, "the gateway does not refuse"
        time.sleep(0.5)
    time.sleep(2.0)  # what belongs to the beginning of the session is over
    took = []
    for each in range(REFUSALS):
        time.sleep(PACE_S)
        for _ in drained(link):
            pass
        number, asked = request(each)
        begun = time.monotonic()
        link.send(asked)
        assert result(link, number) == DENIED
        took.append(1_000 * (time.monotonic() - begun))
    return took


#: what is refused, in words
REQUESTS: dict[str, Callable[[int], tuple[int, bytes]]] = {
    "take-off above the limit": too_high,
    "go-to beyond the field": beyond,
}


# ---------------------------------------------------------------- the run


class Found(NamedTuple):
    """What was found of one router."""

    latency_ms: list[float]
    lost: int
    throughput: float


def measured(routers: dict[str, Callable[[], AbstractContextManager[Bench]]]) -> dict[str, Found]:
    """Measure all routers, in turns."""
    latencies: dict[str, list[float]] = {name: [] for name in routers}
    lost = dict.fromkeys(routers, 0)
    rates: dict[str, list[int]] = {name: [] for name in routers}
    for turn in range(max(BLOCKS, ROUNDS)):
        for name, open_router in routers.items():
            with open_router() as bench:
                if turn < BLOCKS:
                    found, missing = bench.latencies(FRAMES)
                    latencies[name] += [each / 1e6 for each in found]
                    lost[name] += missing
                if turn < ROUNDS:
                    rates[name].append(bench.throughput())
                bench.close()
    return {name: Found(latencies[name], lost[name], median(rates[name])) for name in routers}


def judged(text: str, *, held: bool) -> bool:
    """Print a limit; return whether it is missed."""
    print(f"{'held  ' if held else 'MISSED'} {text}")
    return not held


def main() -> int:
    """Measure and print; return 1 if a limit is missed."""
    if sys.argv[1:2] == ["--relay"]:
        relay(int(sys.argv[2]), [int(each) for each in sys.argv[3:]])
        return 0
    routers: dict[str, Callable[[], AbstractContextManager[Bench]]] = {
        "bare relay": bare,
        "gateway": gateway,
        "MAVProxy": mavproxy,
    }
    if shutil.which("mavlink-routerd"):
        routers["mavlink-router"] = mavlink_router
    found = measured(routers)
    print(f"{RATE} frames/s to {CLIENTS} clients; throughput without loss, each within {1_000 * LATE_S:.0f} ms")
    print(f"{'':<16}{'median':>10}{'99 %':>10}{'lost':>8}{'frames/s':>12}")
    for name, (latency, lost, rate) in found.items():
        late = sorted(latency)[int(0.99 * len(latency))] if latency else 0.0
        print(f"{name:<16}{median(latency or [0]):>7.3f} ms{late:>7.3f} ms{lost:>8}{rate:>12.0f}")
    with whole_gateway() as link:
        refused = {name: refusals(link, request) for name, request in REQUESTS.items()}
    ours = found["gateway"]
    added = median(ours.latency_ms) - median(found["bare relay"].latency_ms)
    missed = judged(f"added latency {added:.3f} ms at the median, limit {ADDED_MS}", held=added <= ADDED_MS)
    missed |= judged(f"{ours.lost} frames lost at {RATE} frames/s, limit 0", held=ours.lost == 0)
    for name, limit in (("MAVProxy", OF_MAVPROXY), ("mavlink-router", OF_ROUTER)):
        if name in found:
            ratio = ours.throughput / max(1.0, found[name].throughput)
            missed |= judged(f"{ratio:.2f} times the throughput of {name}, at least {limit}", held=ratio >= limit)
    for name, took in refused.items():
        typical, late = median(took), sorted(took)[int(0.99 * len(took))]
        text = f"{name} refused in {typical:.2f} ms at the median, {late:.2f} ms at 99 %, limit {REFUSAL_MS}"
        missed |= judged(text, held=typical <= REFUSAL_MS)
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
