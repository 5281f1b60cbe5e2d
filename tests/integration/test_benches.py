"""A sample run of each benchmark, without checking figures. `make bench` measures."""

import os
import sys
import traceback
import warnings
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from signal import SIGKILL
from tempfile import TemporaryFile
from time import monotonic, sleep
from typing import IO, Any

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
#: by benchmark, what of it is made smaller; `_` are its words on the command line
SAMPLES: dict[str, dict[str, Any]] = {
    "agent_host": {"ROUNDS": 1, "CALLS": 2, "THINKS_S": 0.1},
    "analysis": {"SIZES": (20, 40), "ROUNDS": 1},
    "archive": {"VEHICLES": 2, "FLIGHTS": 3, "EACH": 20, "MISSING": (0, 1), "CHANGED": (1, 1)},
    "boundary": {"ROUNDS": 1, "BATCHES": 1, "CALLS": 2, "TURNS": 1},
    "boundary_process": {"BLOCKS": 1, "ROUNDS": 2, "STARTS": 1},
    "compile": {"SIZES": (200, 400), "ROUNDS": 1},
    "day": {"HOURS": 1, "FLIGHTS": 1, "TEN": 1},
    "decide": {"ROUNDS": 1, "CALLS": 2, "KEYS": 20, "WIDE": 20},
    "documents": {"BLOCKS": 1, "ROUNDS": 2},
    "editor": {"LINES": 300, "ROUNDS": 1, "PAUSE": 0.01, "KINDS": {"the first line": ("import ", "imports")}},
    "end_to_end": {"ROUNDS": {"short": (1, 1)}},
    "endurance": {"HOURS": 1, "HOUR_US": 120_000_000},
    "enforce": {"BLOCKS": 1, "ROUNDS": 2},
    "evidence": {"RECORDS": 1_100, "SYNCED_RECORDS": 3, "ROUNDS": 1, "BLOCK": 100},
    "fence": {"LARGEST": 200, "ROUNDS": 1, "PLACES": 10, "PEER_S": 0.05},
    "fleet": {"VEHICLES": 1, "SPEED": 10},
    "flood": {"BLOCKS": 1, "BLOCK_S": 0.5, "STEPS": (4, 20), "TRIES": 1},
    "format": {"LINES": 100, "ROUNDS": 1},
    "gateway": {"FRAMES": 50, "BLOCKS": 1, "BURST_S": 0.1, "TRIES": 1, "ROUNDS": 1, "MOST": 500, "REFUSALS": 5},
    "hostile_link": {"DATAGRAMS": 8_000, "BLOCK": 1_000, "GOOD": 100},
    "isolation": {"BLOCKS": 1, "ROUNDS": 2},
    "lint": {"ROUNDS": 1, "FEW": 10, "MANY": 20},
    "many_rules": {"FEW": 10, "MANY": 40, "ROUNDS": 1},
    "missions": {"SIZES": (15, 30), "ROUNDS": 1},
    "parse": {"LINES": 100, "MOST_LINES": 400, "ROUNDS": 1},
    "proofs": {"SIZE": 256, "BLOCKS": 1, "ROUNDS": 2},
    "reaction": {"PROCESSES": 1, "IN_PROCESS": 2, "QUICK": 2, "MUTE": 1},
    "recall": {"RECALLS": 1, "RESTARTS": 1, "FLAVOURS": ("px4",)},
    "recorded_flights": {},
    "report": {"LEGS": 2, "RUNS": 1, "CHROMIUM": None},
    "startup": {"ROUNDS": 1, "COMMANDS": (("--help",), ("check", "missions/short.rts"))},
    "verify": {"RECORDS": 300, "ROUNDS": 1},
    "virtual_time": {"NAMES": ("short",), "MANY": "short", "FRAMES": 5, "MANY_FRAMES": 5, "ROUNDS": 1},
    "witness": {"EPOCHS": 2, "RECORDS": 16, "BLOCKS": 1},
}


def measure(name: str, changed: dict[str, Any]) -> None:
    """Run a benchmark, with constants of it changed. A limit may be missed, for a sample says nothing about figures;
    whatever else ends it is an error, `SystemExit` too.
    """
    path = CHECKOUT / "bench" / f"{name}.py"
    sys.argv = [str(path)]
    sys.path.insert(0, str(path.parent))
    sys.modules.pop(name, None)  # `boundary` is a package of these tests, too
    module = import_module(name)
    assert [each for each in changed if not hasattr(module, each)] == []
    vars(module).update(changed)
    end = module.main()
    assert end in (0, 1), end
    print("measured", end)


def begun(name: str, changed: dict[str, Any], folder: Path, out: IO[bytes], err: IO[bytes]) -> int:
    """Begin a benchmark in a session of its own, forked from this process, which has loaded what most of them load."""
    process = os.fork()
    if process:
        return process
    code = 1
    try:
        os.setsid()
        os.chdir(folder)
        os.dup2(out.fileno(), 1)
        os.dup2(err.fileno(), 2)
        sys.stdout, sys.stderr = (os.fdopen(number, "w", closefd=False, encoding="utf-8") for number in (1, 2))
        warnings.resetwarnings()
        measure(name, changed)
        code = 0
    except BaseException:  # noqa: BLE001  nothing of it goes on in pytest
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def processes(session: int) -> list[int]:
    """What runs in a session."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, _, _, its = stat.read_text().rpartition(")")[2].split()[:4]
            if int(its) == session and state not in "ZX":
                found.append(int(stat.parent.name))
    return found


def test_flooding_process_ends_with_its_benchmark(tmp_path: Path) -> None:
    with TemporaryFile() as out:
        bench = begun("flood", {"BLOCK_S": 60.0}, tmp_path, out, out)
        patience = monotonic() + 60
        while len(processes(bench)) < 3 and monotonic() < patience:
            sleep(0.05)
        they = processes(bench)
        os.kill(bench, SIGKILL)
        os.waitpid(bench, 0)
    while (left := processes(bench)) and monotonic() < patience:
        sleep(0.05)
    for each in left:
        os.kill(each, SIGKILL)
    assert len(they) == 3
    assert left == []


def test_every_benchmark_has_a_sample() -> None:
    assert {path.stem for path in (CHECKOUT / "bench").glob("*.py")} == set(SAMPLES)


@pytest.mark.slow
@pytest.mark.parametrize("name", SAMPLES)
def test_a_sample_of_each_benchmark_runs(name: str, tmp_path: Path) -> None:
    with TemporaryFile() as out, TemporaryFile() as err:
        _, status = os.waitpid(begun(name, SAMPLES[name], tmp_path, out, err), 0)
        told, wrong = (os.pread(each.fileno(), 1 << 20, 0).decode() for each in (out, err))
    assert os.waitstatus_to_exitcode(status) == 0, wrong
    assert "Traceback" not in wrong, wrong  # of a process that it started
    *lines, last = told.splitlines()
    assert lines
    assert last in ("measured 0", "measured 1"), told
