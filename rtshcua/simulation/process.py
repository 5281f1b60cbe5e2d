"""The simulated vehicle as a process: `python -m rtshcua.simulation --port 14550`.

A thin loop around `world.Simulation`: one UDP socket on the loopback interface, real time times `--speed`. It sends to
one peer and hears only that one, as a real link does. When it is up it prints one line of JSON. It ends on SIGTERM,
and, if its standard input is a pipe, when the other end of that closes, so that it never outlives who started it.
"""

import json
import os
import selectors
import signal
import socket
import stat
import sys
import time
from collections.abc import Sequence

from rtshcua.simulation.autopilot import TICK_US
from rtshcua.simulation.options import config_of, parser
from rtshcua.simulation.world import Simulation

EXIT_OK = 0
EXIT_USAGE = 2
"""A bad option, from argparse."""
EXIT_PORT = 3
"""The port cannot be had."""

_LEAP_US = 250_000
"""The simulation never catches up by more than this at once: a process that was stopped loses the time."""
_SHORTEST_SLEEP_S, _LONGEST_SLEEP_S = 0.001, 0.05
_LARGEST_DATAGRAM = 65_535


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the simulated vehicle until it is told to end; the exit code."""
    options = parser().parse_args(arguments)
    try:
        config = config_of(options, time.time_ns() // 1000)
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
        loop = _Loop(Simulation(config), link, ("127.0.0.1", options.port), options.speed)
        with selectors.DefaultSelector() as selector:
            loop.listen(selector)
            sys.stdout.write(json.dumps(ready) + "\n")
            sys.stdout.flush()
            loop.follow(selector)
    return EXIT_OK


class _Loop:
    def __init__(self, simulation: Simulation, link: socket.socket, peer: tuple[str, int], speed: float) -> None:
        self._simulation = simulation
        self._link = link
        self._peer = peer
        self._speed = speed
        self._ended = False

    def listen(self, selector: selectors.BaseSelector) -> None:
        """Begins to listen to the peer, and to whoever may end the process."""
        selector.register(self._link, selectors.EVENT_READ)
        signal.signal(signal.SIGTERM, self._end)
        if _stdin_is_a_pipe():
            selector.register(sys.stdin, selectors.EVENT_READ)
            # Ctrl-C in a terminal goes to the whole group; the vehicle flies on while its parent brings it home.
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        else:
            signal.signal(signal.SIGINT, self._end)

    def follow(self, selector: selectors.BaseSelector) -> None:
        """Lets the simulation follow real time until it is told to end."""
        sleep = min(max(TICK_US / 1_000_000 / self._speed, _SHORTEST_SLEEP_S), _LONGEST_SLEEP_S)
        last, now_us = time.monotonic(), 0.0
        while not self._ended:
            ready = [key.fileobj for key, _ in selector.select(sleep)]
            now = time.monotonic()
            now_us += min((now - last) * self._speed * 1_000_000, _LEAP_US)
            last = now
            if sys.stdin in ready and not os.read(sys.stdin.fileno(), 4096):
                return
            if self._link in ready:
                self._hear(int(now_us))
            self._send(self._simulation.advance(int(now_us)))

    def _hear(self, at_us: int) -> None:
        while True:
            try:
                data, sender = self._link.recvfrom(_LARGEST_DATAGRAM)
            except BlockingIOError:
                return
            if sender == self._peer:
                self._send(self._simulation.receive(data, at_us))

    def _send(self, frames: list[bytes]) -> None:
        for frame in frames:
            try:
                self._link.sendto(frame, self._peer)
            except BlockingIOError:
                return  # the send buffer is full: what does not fit is lost, as on a radio

    def _end(self, *_: object) -> None:
        self._ended = True


def _stdin_is_a_pipe() -> bool:
    try:
        mode = os.fstat(sys.stdin.fileno()).st_mode
    except (AttributeError, OSError, ValueError):
        return False
    return stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode)
