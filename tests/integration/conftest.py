"""`rtshcua run` as a user starts it: a separate process, real keys, files and UDP, and the simulated vehicle."""

import json
import os
import re
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from reference.verifiers import agree, careful
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.model.flat.mission import Invocation
from rtshcua.wire.keys import Duty
from virtual import case
from virtual.forked import Forked, Started

PATIENCE_S = 240.0
#: Faster, and what must leave within 1.5 s of flight must leave within less than a busy machine may hold a process up.
SPEED = 5
AFRESH = (sys.executable, "-m", "rtshcua")


class Run:
    """A running `rtshcua run --json`, or another command with JSON lines, in `folder`."""

    def __init__(self, folder: Path, process: "subprocess.Popen[bytes] | Started") -> None:
        self.cwd = folder
        self.until_s = time.monotonic() + PATIENCE_S
        self.events: list[dict[str, Any]] = []
        self.code: int | None = None
        self.stderr = ""
        self._rest = b""
        self.process = process

    def until(self, event: str, **fields: Any) -> dict[str, Any]:
        """Wait for an event with these fields."""
        looked = 0
        while True:
            for found in self.events[looked:]:
                looked += 1
                if found["event"] == event and all(found.get(name) == value for name, value in fields.items()):
                    return found
            assert self._read(), f"it ended without {event} {fields}: {self.events} {self.end().stderr}"

    def end(self) -> "Run":
        """Wait until it ends."""
        while self._read():
            pass
        self.stderr = self.process.stderr.read().decode()
        self.code = self.process.wait(PATIENCE_S)
        assert "Traceback" not in self.stderr, self.stderr
        return self

    def signal(self, number: signal.Signals) -> None:
        self.process.send_signal(number)

    def child(self, module: str) -> int:
        """Return the process of a module that it started."""
        pid = self.process.pid
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        (found,) = [child for child in children if module in Path(f"/proc/{child}/cmdline").read_text()]
        return int(found)

    @property
    def summary(self) -> dict[str, Any]:
        return next(event for event in self.events if event["event"] == "summary")

    @property
    def folder(self) -> Path:
        """Return the run's folder."""
        (folder,) = (self.cwd / "runs").iterdir()
        return folder

    def log(self) -> list[dict[str, Any]]:
        """The records of the log."""
        return [json.loads(line) for line in (self.folder / "log.jsonl").read_text().splitlines()]

    def effects(self) -> list[str]:
        """The effects in the log, by slug."""
        return [record["event"] for record in self.log() if record["type"] == "effect"]

    def dispatched(self) -> list[str]:
        """The skills of which a command was sent, in order: a busy machine may miss a permit's time, and ask again."""
        sent: list[str] = []
        for record in self.log():
            if record["type"] == "effect" and record["event"] == "dispatched":
                sent.append(record["detail"])
            elif record["type"] == "effect" and record["detail"] == "permit/unsent":
                sent.pop()
        return sent

    def http_port(self, token: Path) -> int:
        """The port that `rtshcua mcp --http` says that it serves, without its token; a note may come before."""
        said = b""
        while b"token`\n" not in said and (line := self.process.stderr.readline()):
            said += line
        found = re.search(rb"http://127\.0\.0\.1:(\d+)/mcp", said)
        assert found, said
        assert token.read_bytes().strip() not in said
        return int(found[1])

    def _read(self) -> bool:
        out = self.process.stdout
        left = self.until_s - time.monotonic()
        ready = select.select([out], [], [], max(0.0, left))[0]
        assert ready, f"it took too long: {self.events}"
        data = os.read(out.fileno(), 65_536)
        *lines, self._rest = (self._rest + data).split(b"\n")
        self.events += [json.loads(line) for line in lines]
        return bool(data)


class Ground:
    """A user's machine: keys, bundles, and started commands.

    Where `command` is None, what is started comes from `commands`, which has loaded it already; `afresh` is for those
    where the start counts too: some test starts each command that goes on for a while so.
    """

    afresh = AFRESH

    def __init__(self, folder: Path, data: Path, commands: Forked, **witnesses: int) -> None:
        self.folder = folder
        self.environment = os.environ | {"RTSHCUA_DATA_DIR": str(data), "TZ": "UTC"}
        self.store = KeyStore(data)
        now_us = time.time_ns() // 1_000
        self.store.create(
            lambda: os.urandom(32), development=True, passphrase=None, now_us=now_us, expires_us=now_us + case.YEAR_US,
            **witnesses,
        )  # fmt: skip
        self._commands, self.speed = commands, SPEED
        self.command: Sequence[str] | None = None
        self.program = commands.program(folder / "rtshcua")
        self.started: list[Run] = []

    def bundle(
        self, steps: Sequence[Invocation] | None = None, name: str = "flight", return_mm: int = case.LOW, *,
        age_s: int = 0,
    ) -> str:  # fmt: skip
        """A bundle issued now, or so long ago, of these steps or else the low ones; its file's name. 0: any height to
        return at.
        """
        mission_key = self.store.signing_key(Duty.MISSION, whose="agent")
        keys = {Duty.POLICY: self.store.signing_key(Duty.POLICY), Duty.MISSION: mission_key}
        mission = case.mission(
            case.low_steps() if steps is None else steps, time.time_ns() // 1_000 - age_s * 1_000_000
        )
        policy = case.policy()
        policy = replace(policy, vehicle=replace(policy.vehicle, return_altitude=return_mm))
        (self.folder / f"{name}.bundle").write_bytes(case.seal(mission, policy, keys))
        return f"{name}.bundle"

    def start(self, *words: str) -> Run:
        if self.command is not None:
            return self._begun([*self.command, *words])
        self.started.append(Run(self.folder, self._commands.start(words, self.folder, self.environment)))
        return self.started[-1]

    def _begun(self, command: Sequence[str]) -> Run:
        process = subprocess.Popen(
            command, cwd=self.folder, env=self.environment,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        self.started.append(Run(self.folder, process))
        return self.started[-1]

    def vehicle(self, port: int, speed: int = SPEED, *words: str) -> Run:
        """A simulated vehicle for a run that does not start its own; it is ready."""
        command = [sys.executable, "-m", "rtshcua.simulation", "--port", str(port), "--speed", str(speed)]
        returning = ["--return-at", str(case.LOW // case.M)]
        started = self._begun([*command, *returning, *words])
        started.until("ready")
        return started

    def run(self, bundle: str, *words: str, speed: int = SPEED) -> Run:
        return self.start("run", bundle, "--json", "--speed", str(speed), *words)


@contextmanager
def a_ground(folder: Path, data: Path, commands: Forked, **witnesses: int) -> Iterator[Ground]:
    made = Ground(folder, data, commands, **witnesses)
    try:
        yield made
    finally:
        for run in made.started:
            if run.process.poll() is None:
                run.process.kill()
            run.process.communicate()
    for log in folder.glob("runs/*/log.jsonl"):  # in any case two verifiers must agree about the log
        agree(log.read_bytes(), careful(log.read_bytes(), made.store.pin()), made.store.pin())


@pytest.fixture
def ground(tmp_path: Path, own_world: None, commands: Forked) -> Iterator[Ground]:
    with a_ground(tmp_path, Path(os.environ["RTSHCUA_DATA_DIR"]), commands) as made:
        yield made


@pytest.fixture(scope="session")
def grounds(commands: Forked) -> Callable[..., AbstractContextManager[Ground]]:
    """Makes what outlives a test, so that several look at one flight: folder, data folder, numbers of witnesses."""
    return lambda folder, data, **witnesses: a_ground(folder, data, commands, **witnesses)


@pytest.fixture(scope="session")
def free_port() -> Callable[[], int]:
    """Return a free UDP port."""

    def found() -> int:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            return int(probe.getsockname()[1])

    return found


@pytest.fixture
def port(free_port: Callable[[], int]) -> int:
    return free_port()
