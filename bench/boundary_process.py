"""The boundary process: the time that it adds to a request over mode `software`, and its start time.

Both modes answer the same requests in turns: an allowed step in a new session, and an allowed and dispatched link of
the contingency. The start is measured from the start of the program to its greeting, and to the answer that the
bundle is in force. Because of noise, percentiles are those of the quietest block; the median block is printed too.
Exits with 1 when a limit is missed.
"""

import sys
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter_ns, sleep, time_ns

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from msgspec.structs import replace

from reference import flat_case as flat
from reference.world import ROOT, ROOT_KEY, START, VEHICLE, loaded, renewed, request_for, sealed_again
from rtshcua.adapters.boundary.process import BoundaryProcess
from rtshcua.model.decision import Decision
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.isolated import Caller
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load
from rtshcua.onboard.ports import Command
from rtshcua.wire.request import CONTINGENCY_LINK
from rtshcua.wire.response import decode
from virtual import case
from virtual.shipped import shipped

ADDED_MEDIAN_US, ADDED_P99_US, START_MS = 300.0, 1_000.0, 150.0
BLOCKS, ROUNDS, STARTS = 61, 100, 15
PAUSE_S = 0.002
"""The pause before each request: a runtime sends about ten a second and is idle in between."""
PIN = ROOT_KEY.verification().public

Blocks = list[list[float]]


def isolated(caller: Caller, bundle: bytes) -> Loaded:
    """Load the bundle in the boundary process."""
    found = load(
        bundle, root=ROOT, vehicle=VEHICLE, now=START, mode=EnforcementMode.PROCESS, session_key=bytes(32),
        flight=bytes(16),
        peer_is_own_simulator=False, caller=caller,
    )  # fmt: skip
    assert isinstance(found, Loaded), found
    return found


def asked(of: Loaded, request: bytes) -> tuple[bytes, float]:
    """Return the permit of a request that must be allowed, and the time, us."""
    begin = perf_counter_ns()
    answer = of.boundary.enforce(request)
    taken = perf_counter_ns() - begin
    said = decode(answer, of.bundle.policy, of.invocations[0].invocation.contract)
    assert isinstance(said, Decision), said
    assert said.permit, said
    return said.permit, taken / 1e3


def dispatched(of: Loaded, request: bytes) -> float:
    """Return the time of an allowed and dispatched link, us."""
    permit, taken = asked(of, request)
    begin = perf_counter_ns()
    sent = of.executor.dispatch(permit, START.monotonic_us)
    assert isinstance(sent, Command), sent
    return taken + (perf_counter_ns() - begin) / 1e3


def added(name: str, here: Blocks, there: Blocks) -> bool:
    """Print the added time of the process, from blocks measured in turns; return whether the limits hold."""
    held = True
    for share, limit in ((50, ADDED_MEDIAN_US), (99, ADDED_P99_US)):
        figures = [[sorted(block)[len(block) * share // 100] for block in blocks] for blocks in (here, there)]
        (software, usual), (process, usually) = ((min(each), median(each)) for each in figures)
        held = held and process - software <= limit
        print(
            f"{'held  ' if process - software <= limit else 'MISSED'}  {name}, {'median' if share == 50 else 'p99'}: "
            f"process adds {process - software:.0f} us to {software:.0f} us in software, limit {limit:.0f} us "
            f"(median block: {usually - usual:.0f} to {usual:.0f} us)"
        )
    return held


def requests(folder: Path) -> bool:
    """Measure requests of both modes; return whether the limits hold."""
    survey = replace(flat.INVOCATIONS[flat.INSPECTION_STEP], step=0)
    software = loaded(mission=replace(flat.MISSION, invocations=(survey,)))
    bundle = sealed_again(software)
    step = request_for(software, state=flat.state())
    link = request_for(software, CONTINGENCY_LINK, -1, 0, state=flat.state())
    process = BoundaryProcess(ROOT.sign(ROOT_KEY), PIN, VEHICLE, folder, paced=True)
    try:
        caller = Caller(process.call)
        apart = isolated(caller, bundle)
        steps: tuple[Blocks, Blocks] = ([], [])
        links: tuple[Blocks, Blocks] = ([], [])
        for block in range(BLOCKS):
            for of in steps:
                of.append([])
            for _ in range(ROUNDS):
                steps[0][block].append(asked(renewed(software), step)[1])
                # no frame of it was sent, so it can be loaded again
                assert isinstance(caller.load(bundle, START), bytes)
                sleep(PAUSE_S)
                steps[1][block].append(asked(apart, step)[1])
        for _ in range(BLOCKS):
            pairs = []
            for _ in range(ROUNDS):
                sleep(PAUSE_S)
                pairs.append((dispatched(software, link), dispatched(apart, link)))
            for of, taken in zip(links, zip(*pairs, strict=True), strict=True):
                of.append(list(taken))
        allowed, sent = added("a step allowed", *steps), added("a link allowed and dispatched", *links)
        return allowed and sent
    finally:
        process.close()


def starts() -> bool:
    """Measure starts with a shipped bundle, each in an empty folder; return whether the limit holds."""
    issued_us = time_ns() // 1_000 - 60_000_000  # the process checks the root by its own clock
    signed, bundle = case.root(issued_us)[1], shipped("standard", issued_us)
    now = Now(START.monotonic_us, issued_us + 60_000_000, START.utc_error_us)
    pin = case.KEYS[next(iter(case.KEYS))].kid
    greeted, ready = [], []
    for _ in range(STARTS):
        with TemporaryDirectory() as name:
            begin = perf_counter_ns()
            process = BoundaryProcess(signed, pin, VEHICLE, Path(name), paced=True)
            greeted.append((perf_counter_ns() - begin) / 1e6)
            answer = Caller(process.call).load(bundle, now)
            ready.append((perf_counter_ns() - begin) / 1e6)
            process.close()
            assert isinstance(answer, bytes), answer
    held = max(ready) <= START_MS
    print(
        f"{'held  ' if held else 'MISSED'}  start: greeting after {median(greeted):.0f} ms, bundle of {len(bundle)} "
        f"octets in force after {median(ready):.0f} ms; the slowest of {STARTS}: {max(greeted):.0f} and "
        f"{max(ready):.0f} ms, limit {START_MS:.0f} ms"
    )
    return held


def main() -> int:
    """Measure and print; return 1 if a limit is missed."""
    with TemporaryDirectory() as name:
        added_little = requests(Path(name))
    started_soon = starts()
    return int(not (added_little and started_soon))


if __name__ == "__main__":
    sys.exit(main())
