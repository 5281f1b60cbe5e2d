"""The time of a recall from the command line to the flight's socket, and of a restarted run from its start to the first
motion frame.

Elapsed time on an otherwise idle machine, with `python -c pass` for comparison. Exits with 1 when a median is above its
limit.
"""

import json
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from statistics import median
from typing import Any

from rtshcua.adapters.agent_socket import AgentSocket
from rtshcua.mavlink.framing import message_id

RTSHCUA = str(Path(sys.executable).with_name("rtshcua"))
MISSION = Path(__file__).resolve().parents[1] / "missions" / "short.rts"
RECALLS, RESTARTS = 9, 3
FLAVOURS = ("px4", "ardupilot")
RECALL_LIMIT_S, CONSOLE_LIMIT_S, RESTART_LIMIT_S = 0.3, 0.05, 1.5
FLIGHT = bytes(16)
AIRBORNE_MM = 5_000
PATIENCE_S = 60.0
COMMANDS = {75, 76}  # COMMAND_INT, COMMAND_LONG: the command's number stands behind seven or four of four octets
#: DO_SET_MODE, DO_REPOSITION, NAV_LAND, NAV_RETURN_TO_LAUNCH; SET_POSITION_TARGET_GLOBAL_INT and SET_MODE are messages
MOVING, MOVING_MESSAGES = {176, 192, 21, 20}, {86, 11}


def rtshcua(*words: str, env: dict[str, str]) -> None:
    """Run a command that must succeed."""
    subprocess.run([RTSHCUA, *words], env=env, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


@contextmanager
def listening(folder: Path) -> Iterator[tuple[Path, list[float]]]:
    """A flight's socket that accepts everything and records the time."""
    hello = json.dumps({"type": "hello", "flight": FLIGHT.hex()}).encode() + b"\n"
    agents, came, over = AgentSocket(folder / "s", lambda: hello), list[float](), threading.Event()

    def serve() -> None:
        while not over.is_set():
            event = agents.poll(time.monotonic_ns() // 1_000)
            if event is None:
                time.sleep(0.001)
                continue
            came.append(time.monotonic())
            agents.answer(event.sender, "accepted", "taken")

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield agents.path, came
    finally:
        over.set()
        thread.join()
        agents.close()


def recalls(bundle: Path, folder: Path, env: dict[str, str]) -> tuple[float, float, float, float]:
    """Return medians in s: a start of Python, a signed recall, a sent recall, a recall at the operator's console."""
    bare, signed, sent, console = list[float](), list[float](), list[float](), list[float]()
    home = folder / "home"
    rtshcua("recall", str(bundle), "--flight", FLIGHT.hex(), "-o", str(home), env=env)
    with listening(folder) as (path, came), ExitStack() as stack:
        for _ in range(RECALLS):
            begun = time.monotonic()
            subprocess.run([sys.executable, "-c", "pass"], check=True)
            bare.append(time.monotonic() - begun)
            for words, times in ((["recall", str(bundle)], signed), (["recall", "--send", str(home)], sent)):
                begun = time.monotonic()
                rtshcua(*words, "--to", str(path), env=env)
                times.append(came[-1] - begun)
        operator = stack.enter_context(
            subprocess.Popen(
                [RTSHCUA, "operator", str(bundle), "--to", str(path)],
                env=env,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
        )
        assert operator.stdin is not None
        assert operator.stdout is not None
        for _ in range(2):
            operator.stdout.readline()
        for _ in range(RECALLS):
            begun = time.monotonic()
            print("recall", file=operator.stdin, flush=True)
            for _ in range(2):  # sent, accepted
                operator.stdout.readline()
            console.append(came[-1] - begun)
        print("quit", file=operator.stdin, flush=True)
    return median(bare), median(signed), median(sent), median(console)


def moves(datagram: bytes) -> bool:
    """Return whether it contains a motion frame. A MAVLink 2 payload begins after ten octets."""
    kind = message_id(datagram, 0)
    if kind not in COMMANDS:
        return kind in MOVING_MESSAGES
    at = 10 + 28  # seven of four octets stand before the command in both
    return int.from_bytes(datagram[at : at + 2], "little") in MOVING


def height_mm(datagram: bytes) -> int:
    """Return the height above home of a GLOBAL_POSITION_INT, otherwise 0. Trailing zero octets are not sent."""
    if message_id(datagram, 0) != 33:
        return 0
    said = datagram[10 : 10 + datagram[1]].ljust(28, b"\0")
    return int.from_bytes(said[16:20], "little", signed=True)


def restart(flavour: str, folder: Path, env: dict[str, str]) -> float:
    """Return the seconds from the start of the restarted run to its first motion frame."""
    folder.mkdir()
    bundle = folder / "short.bundle"
    rtshcua("compile", str(MISSION), "-o", str(bundle), env=env)
    theirs, ours, free = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(3))
    for each in (theirs, free):
        each.bind(("127.0.0.1", 0))
    port = free.getsockname()[1]
    free.close()
    ours.connect(("127.0.0.1", port))
    for each in (theirs, ours):
        each.setblocking(False)
    words = [
        RTSHCUA, "run", str(bundle), "--connect", f"udpin:127.0.0.1:{port}", "--vehicle", "quad-07", "--plain",
        "--utc-error", "500ms",  # without a synchronised clock, as in a container, every step would be deferred
        "--runs", str(folder / "runs"), "--state-dir", str(folder / "state"),
    ]  # fmt: skip
    quiet: Any = {"env": env, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    vehicle_port = str(theirs.getsockname()[1])
    with subprocess.Popen([RTSHCUA, "sim", "--flavour", flavour, "--port", vehicle_port], **quiet) as sim:
        run = subprocess.Popen(words, **quiet)
        try:
            return relayed(theirs, ours, run, words, quiet)
        finally:
            sim.kill()
            theirs.close()
            ours.close()


def relayed(
    theirs: socket.socket, ours: socket.socket, run: "subprocess.Popen[bytes]", words: list[str], quiet: Any
) -> float:
    """Forward frames between vehicle and run, kill the run in the air, and restart it."""
    vehicle, begun, until_s = None, None, time.monotonic() + PATIENCE_S
    try:
        while time.monotonic() < until_s:
            for each in select.select([theirs, ours], [], [], 0.01)[0]:
                try:
                    datagram, sender = each.recvfrom(65_535)
                except OSError:  # an ICMP error: the run does not listen
                    continue
                if each is theirs:
                    vehicle = sender
                    with suppress(OSError):
                        ours.send(datagram)
                    if begun is None and height_mm(datagram) > AIRBORNE_MM:
                        os.kill(run.pid, signal.SIGKILL)
                        run.wait()
                        while select.select([ours], [], [], 0)[0]:
                            try:
                                ours.recv(65_535)
                            except OSError:
                                break
                        begun = time.monotonic()
                        run = subprocess.Popen(words, **quiet)
                elif vehicle is not None:
                    theirs.sendto(datagram, vehicle)
                    if begun is not None and moves(datagram):
                        return time.monotonic() - begun
        raise SystemExit("no run was begun again that moved the vehicle")
    finally:
        run.kill()
        run.wait()


def main() -> int:
    """Print the table."""
    with tempfile.TemporaryDirectory(prefix="rts-") as name:
        folder = Path(name)
        env = os.environ | {"RTSHCUA_DATA_DIR": str(folder / "data")}
        env.pop("PYTHONDONTWRITEBYTECODE", None)
        rtshcua("keys", "init", env=env)
        bundle = folder / "short.bundle"
        rtshcua("compile", str(MISSION), "-o", str(bundle), env=env)
        bare, signed, sent, console = recalls(bundle, folder, env)
        rows = [
            ("recall, signed now", signed, RECALL_LIMIT_S),
            ("recall --send, signed before", sent, RECALL_LIMIT_S),
            ("operator: recall and Enter", console, CONSOLE_LIMIT_S),
        ]
        for flavour in FLAVOURS:
            times = [restart(flavour, folder / f"{flavour}{number}", env) for number in range(RESTARTS)]
            rows.append((f"begun again after a kill, {flavour}", median(times), RESTART_LIMIT_S))
    print(f"{'python -c pass':32} {bare:6.3f} s")
    for what, seconds, limit in rows:
        print(f"{what:32} {seconds:6.3f} s  limit {limit} s{'' if seconds <= limit else '  MISSED'}")
    return int(any(seconds > limit for _, seconds, limit in rows))


if __name__ == "__main__":
    sys.exit(main())
