"""A whole day: eight hours with ten flights each, in virtual time, each with its own boundary process.

Every flight is the shipped mission `short` on the simulated vehicle, with the code of a real run; all share a state
folder, like the runs of one vehicle. Printed for the boundary: processor time, memory, and the size of its state file;
for the runtime: memory, and the log. Exits with 1 when the last ten flights exceed the first ten by more than the
limits.
"""

import gc
import os
import resource
import sys
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import process_time, time_ns
from typing import Any, NamedTuple
from unittest.mock import patch

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import rtshcua.virtual.flight as flights
from rtshcua.adapters.boundary.home import kept_file
from rtshcua.adapters.boundary.process import BoundaryProcess
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.onboard.enforcement.isolated import Caller
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load
from rtshcua.onboard.ports import BoundaryKey, Ending
from rtshcua.wire.keys import Duty
from virtual import case
from virtual.shipped import shipped, simulated

HOURS, FLIGHTS, TEN = 8, 10, 10
MORE, MORE_BYTES = 1.5, 8 << 20  # ratios of the boundary's processor time and memory; octets of the runtime's memory
OWN_SEED = case.BOUNDARY_KEY.private.private_bytes_raw()
VEHICLE = "quad-07"


class Used(NamedTuple):
    """The resources of one flight: ms, octets, and requests to the process."""

    boundary_ms: float
    boundary_octets: int
    kept: int
    calls: int
    runtime_ms: float
    runtime_octets: int
    log: int


def held_octets(process: int | str, what: str) -> int:
    """Return the memory of a process, from /proc."""
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
    return 1_024 * next(int(line.split()[1]) for line in lines if line.startswith(what))


def children_s() -> float:
    """Return the processor time of ended child processes."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def fly(number: int, issued_us: int, state: Path) -> Used:
    """Fly one flight of the day."""
    bundle, signed = shipped("short", issued_us), case.root(issued_us - case.MIN, boundary=True)[1]
    pin = case.KEYS[Duty.ROOT].kid
    before_s, began_s = children_s(), process_time()
    process = BoundaryProcess(signed, pin, VEHICLE, state, own_seed=OWN_SEED, paced=True)
    calls = 0

    def call(octets: bytes) -> bytes:
        nonlocal calls
        calls += 1
        return process.call(octets)

    def loaded(data: bytes, **given: Any) -> Loaded | Refusal:
        return load(data, **{**given, "mode": EnforcementMode.PROCESS, "caller": Caller(call)})

    kept = kept_file(state, VEHICLE)
    try:
        with patch.object(flights, "load", loaded):
            flight = flights.VirtualFlight(
                bundle, simulated("px4"), root=signed, log_key=case.KEYS[Duty.LOG], utc_us=issued_us + case.MIN,
                tick_us=50_000, boundary=BoundaryKey(case.BOUNDARY_KEY, number, bytes(32)),
            )  # fmt: skip
        flown = flight.fly()
        assert flown.ending is Ending.COMPLETED, flown.ending
        octets = held_octets(process.pid, "VmHWM")
    finally:
        process.close()
    took_s = process_time() - began_s
    log = sum(map(len, flown.lines))
    del flown
    gc.collect()
    boundary_ms = (children_s() - before_s) * 1e3
    return Used(boundary_ms, octets, kept.stat().st_size, calls, took_s * 1e3, held_octets("self", "VmRSS"), log)


def main() -> int:
    """Fly and print; return 1 if the resources grew too much."""
    issued_us = time_ns() // 1_000 - HOURS * 3_600 * case.S  # the boundary checks the root by the machine's clock
    with TemporaryDirectory() as name:
        day = [fly(number, issued_us + number * 6 * case.MIN, Path(name)) for number in range(HOURS * FLIGHTS)]
        files = sum(len(found) for _, _, found in os.walk(name))
    first, last = (Used._make(map(median, zip(*part, strict=True))) for part in (day[:TEN], day[-TEN:]))
    flat = (
        last.boundary_ms <= MORE * first.boundary_ms
        and last.boundary_octets <= MORE * first.boundary_octets
        and last.kept == first.kept
        and last.runtime_octets <= first.runtime_octets + MORE_BYTES
    )
    for when, part in (("first", first), ("last", last)):
        print(
            f"day: the {when} ten of {len(day)} flights, median: boundary {part.boundary_ms:.0f} ms of processor for "
            f"{part.calls:.0f} calls, {part.boundary_octets / 2**20:.1f} MiB, keeps {part.kept / 2**10:.0f} KiB; "
            f"runtime and vehicle {part.runtime_ms:.0f} ms, {part.runtime_octets / 2**20:.0f} MiB, "
            f"log {part.log / 2**10:.0f} KiB"
        )
    total_s, log = sum(each.boundary_ms for each in day) / 1e3, sum(each.log for each in day)
    print(
        f"{'held  ' if flat else 'MISSED'}  day: {HOURS} h, {len(day)} flights: boundary {total_s:.1f} s of processor "
        f"in all, logs {log / 2**20:.1f} MiB, {files} file that the boundary keeps"
    )
    return int(not flat)


if __name__ == "__main__":
    sys.exit(main())
