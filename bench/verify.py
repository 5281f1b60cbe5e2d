"""Verification of a log compared with OpenSSL's SHA-256 of the same file, by `hashlib`: ratios of processor time.

Each figure is the least of several rounds; the gain of several processes is in elapsed time.

The log has the real format: half derivable decisions, half effects, sealed as on board. Exits with 1 when a figure is
above its limit. A number of records as argument sets the length of the log; then the greatest memory of the processes
is printed too, which does not grow with the log.
"""

import gc
import os
import resource
import sys
import tempfile
from collections.abc import Callable, Iterator
from hashlib import file_digest
from itertools import count
from pathlib import Path
from time import perf_counter, process_time

from msgspec.structs import replace

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from reference import flat_case as flat
from rtshcua.adapters.store.verification import VerificationInputs, verify_carefully, verify_quickly
from rtshcua.decision.decide import decide
from rtshcua.decision.durability import durability_of
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy, prepare, prepare_mission
from rtshcua.evidence.log_writer import Recorder
from rtshcua.evidence.report import LogVerdict
from rtshcua.ground.audit.audit import Audit
from rtshcua.model.flat.situation import Context, Now, State
from rtshcua.model.outcome import Outcome
from rtshcua.wire.bundle import open_bundle
from rtshcua.wire.keys import Duty
from rtshcua.wire.request import STEP, Ref
from virtual import case

RECORDS = 262_144
ROUNDS = 3
FAST, QUICK, READ = 1.3, 6.5, 14.0  # multiples of the file's digest, in one process
DERIVED = 20_000  # records a second

LOG_KEY = case.KEYS[Duty.LOG]
ASKED = VerificationInputs(case.KEYS[Duty.ROOT].public)
BUNDLE = case.seal(case.mission(case.short_steps()))
STEP_US = 700  # between two records


def lines(records: int) -> Iterator[bytes]:
    """Make a log of so many records, in which a step is requested repeatedly while the fix quality is unknown."""
    start = flat.ISSUED + 60_000_000
    seeds = count(1)
    recorder = Recorder(
        lambda text: LOG_KEY.sign(text, duty=Duty.LOG), LOG_KEY.public, lambda: next(seeds).to_bytes(32, "big")
    )

    def now(number: int) -> Now:
        return Now(5_000_000 + number * STEP_US, start + number * STEP_US, 1_000)

    root = case.root()
    yield recorder.genesis(
        now(0), bundle=BUNDLE, root=root[1], boot=bytes(16), vehicle="quad-07", mission="inspect_bridge_a",
        mode="software",
    )  # fmt: skip
    bundle = open_bundle(BUNDLE, root=root[0], vehicle="quad-07", now_us=start)
    policy = prepare(bundle.policy)
    assert isinstance(policy, PreparedPolicy)
    invocation = prepare_mission(bundle.mission, policy)[0]
    assert isinstance(invocation, PreparedInvocation)
    flat_invocation = invocation.invocation
    state = State((9_900, 23, None, 10_000, None, 52, 22, 40_000), (500_000, 0, 0, 480_000, 0, 0, 0, 0))
    asked = Context(flat_invocation.binding, "quad-07", 7, 0, now(0).monotonic_us - 1_000, 0, 12_000, ())
    answer = decide(invocation, state, policy, asked, now(0))
    assert answer.outcome is Outcome.DEFER
    assert answer.valid_until_us == now(0).monotonic_us
    ref, invocation_id = Ref(STEP, 0, -1), flat_invocation.invocation_id
    durability = durability_of(flat_invocation.contract, answer.outcome, confirmed=False, kind=STEP)
    for number in range(1, records - 1):
        at = now(number)
        if recorder.due(at):
            yield recorder.seal(at)
        elif number & 1:
            yield recorder.effect(at, "said", ref, token=1, detail="PreArm: " + "wind " * 20)
        else:
            context = replace(asked, released_us=at.monotonic_us - 1_000)
            recorded = replace(answer, valid_until_us=at.monotonic_us)
            yield recorder.decision(at, ref, invocation_id, state, context, recorded, durability)
    yield recorder.close(now(records), ending="completed", tlog=None)


def write(path: Path, records: int) -> None:
    """Write the log to a file."""
    with path.open("wb") as file:
        file.writelines(lines(records))


def seconds(work: Callable[[], Audit | str]) -> tuple[float, float]:
    """Return processor time and elapsed time; the audit must succeed."""
    start, clock = process_time(), perf_counter()
    done = work()
    took = process_time() - start, perf_counter() - clock
    assert isinstance(done, str) or done.report.verdict is LogVerdict.VERIFIED, (
        done.report.failure or done.report.shortfall
    )
    return took


def digest(path: Path) -> str:
    """Return the reference time."""
    with path.open("rb") as file:
        return file_digest(file, "sha256").hexdigest()


def main() -> int:
    """Measure and print; return 1 if a limit is missed."""
    records = int(sys.argv[1]) if len(sys.argv) > 1 else RECORDS
    cores = len(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "log.jsonl"
        start = perf_counter()
        write(path, records)
        size = path.stat().st_size
        made = f"{size >> 20} MiB, {size // records} bytes each, in {perf_counter() - start:.0f} s"
        print(f"verify: {records} records, {made}; {peak()}")
        works: dict[str, tuple[Callable[[], Audit | str], float]] = {
            "sha256": (lambda: digest(path), 0.0),
            "--fast": (lambda: verify_quickly(path, ASKED, fast=True, jobs=1), FAST),
            "as it is": (lambda: verify_quickly(path, ASKED, jobs=1), QUICK),
            "--audit --no-derive": (lambda: verify_carefully(path, ASKED, derive=False), READ),
            "--audit": (lambda: verify_carefully(path, ASKED, derive=True), 0.0),
        }
        if records > RECORDS:
            works.pop("--audit")  # that takes its time
        rounds = ROUNDS if records <= RECORDS else 1
        times: dict[str, list[tuple[float, float]]] = {name: [] for name in works}
        shared = []
        gc.collect()
        for _ in range(rounds):
            for name, (work, _) in works.items():
                times[name].append(seconds(work))
            shared.append(seconds(lambda: verify_quickly(path, ASKED, jobs=cores))[1])
        least = {name: min(cpu for cpu, _ in took) for name, took in times.items()}
        elapsed = {name: min(wall for _, wall in took) for name, took in times.items()}
        failed = False
        for name, (_, limit) in works.items():
            judged = elapsed if name == "--fast" else least
            ratio = judged[name] / judged["sha256"]
            failed |= bool(limit) and ratio > limit
            told = f"{judged[name] * 1e6 / records:.2f} us a record, {ratio:.2f} times SHA-256 of the file"
            print(f"verify {name}: {told}{f', limit {limit}' if limit else ''}")
            if name == "--fast":
                cpu = least[name] / least["sha256"]
                print(f"  elapsed: it verifies signatures while it hashes; {cpu:.2f} times in processor time")
        alone = min(wall for _, wall in times["as it is"])
        print(f"verify: {cores} processes are {alone / min(shared):.2f} times as fast as one")
        if "--audit" in least:
            derived = records / least["--audit"]
            failed |= derived < DERIVED
            print(f"verify --audit: {derived:.0f} records a second on one core, limit {DERIVED}")
        print(f"verify memory: {peak()}")
    return int(failed)


def peak() -> str:
    """Return the greatest memory of any process."""
    own, others = (resource.getrusage(who).ru_maxrss >> 10 for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return f"{own} MiB at most, {others} MiB a worker"


if __name__ == "__main__":
    sys.exit(main())
