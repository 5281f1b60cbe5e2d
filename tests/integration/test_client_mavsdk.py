"""MAVSDK flies the simulated vehicle: its server is a process, and so is the program that asks it."""

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from reference.exported_flight import run_in
from rtshcua.adapters.simulator import Simulator
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app

pytest.importorskip("mavsdk_grpc.bin", reason="MAVSDK has no server for this platform")
pytestmark = pytest.mark.clients

FLIGHT = Path(__file__).with_name("mavsdk_flight.py")
SPEED = 15
PATIENCE_S = 180.0
STEPS = [
    "connected",
    "healthy",
    "set up",
    "fence",
    "armed",
    "took off",
    "disarming refused",
    "went",
    "mission stored",
    "mission flown",
    "returned",
    "disarmed by itself",
    "armed",
    "took off",
    "landed",
    "disarmed",
]


@contextmanager
def process(*command: str) -> Iterator[subprocess.Popen[str]]:
    """A process that says what it does on its standard output, and is gone when this is left, or this process is."""
    leash = shutil.which("setpriv")
    whole = [*([leash, "--pdeathsig", "KILL", "--"] if leash else []), *command]
    started = subprocess.Popen(
        whole, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    try:
        yield started
    finally:
        started.kill()
        started.communicate()


def grpc_port(server: subprocess.Popen[str]) -> str:
    """The port that the server listens on, once it has found a vehicle."""
    assert server.stdout is not None
    said = []
    for line in server.stdout:
        if found := re.search(r"Server set to listen on [\d.]+:(\d+)", line):
            return found[1]
        said.append(line)
    raise AssertionError(f"the server ended: {said}")


@contextmanager
def server(options: Sequence[str], port: int) -> Iterator[str]:
    """A simulated vehicle and MAVSDK's server, linked; where programs reach the server."""
    from mavsdk_grpc import bin as binaries

    path = Path(binaries.__path__[0]) / "mavsdk_server"
    with (
        Simulator(["--port", str(port), "--speed", str(SPEED), "--hover", "60", *options]),
        process(str(path), "-p", "0", f"udpin://127.0.0.1:{port}") as running,
    ):
        yield grpc_port(running)


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_mavsdk_program_flies_the_vehicle(flavour: str, port: int) -> None:
    with server(["--flavour", flavour], port) as there, process(sys.executable, str(FLIGHT), flavour, there) as flight:
        out, _ = flight.communicate(timeout=PATIENCE_S)
    assert flight.returncode == 0, out
    assert out.splitlines() == STEPS


def test_mavsdk_imports_an_exported_plan(port: int, tmp_path: Path) -> None:
    """It reads the files of QGroundControl as that program does: what it would upload is what was planned."""
    run, plan = run_in(tmp_path / "run"), tmp_path / "flight.plan"
    assert app.main(["export", str(run), "--to", "plan", "-o", str(plan)]) == ExitCode.OK
    program = Path(__file__).with_name("mavsdk_plan.py")
    with (
        server(["--flavour", "px4"], port) as there,
        process(sys.executable, str(program), there, str(plan)) as loading,
    ):
        out, _ = loading.communicate(timeout=PATIENCE_S)
    assert loading.returncode == 0, out
    found, written = json.loads(out), json.loads(plan.read_text(encoding="utf-8"))
    items = [
        [each["frame"], each["command"], *each["params"][:4], *(round(1e7 * place) for place in each["params"][4:6])]
        for each in written["mission"]["items"]
    ]
    assert [each[:8] for each in found["mission"]] == items
    assert [each[8] for each in found["mission"]] == [each["params"][6] for each in written["mission"]["items"]]
    fence = written["geoFence"]
    assert len(found["fence"]) == len(fence["circles"]) + sum(len(each["polygon"]) for each in fence["polygons"])
    assert found["rally"] == []
