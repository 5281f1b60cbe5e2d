"""The dispatch path, from a known state to a permitted command, compared with the published figure.

One admission: encode the request, `enforce` in mode `software` (decide, issue the permit), decode the answer, append
the evidence line to a file, check the permit. Signatures were verified at load. Because of noise, percentiles are those
of the quietest block of admissions; the median block is printed too. Exits with 1 when the 95th percentile is above the
limit.
"""

import sys
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter_ns

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from msgspec.structs import replace

from reference import flat_case as flat
from reference.world import LOG_KEY, START, loaded, renewed
from rtshcua.adapters.store.evidence_file import EvidenceFile
from rtshcua.evidence.log_writer import Recorder
from rtshcua.model.durability import WRITTEN
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Append, Command
from rtshcua.onboard.runtime.admission import Admission, InvocationQueue
from rtshcua.onboard.runtime.dispatcher import RemainingLatency
from rtshcua.onboard.runtime.journal import Journal
from rtshcua.wire.keys import Duty
from rtshcua.wire.request import Ref

LIMIT_US, PUBLISHED_US = 100.0, 318.0
BLOCKS, ROUNDS = 21, 200
PARTS = ("enforce and record", "append", "check the permit", "all")


def fresh(of: Loaded) -> Loaded:
    """Load the same bundle in a new session, so that its step can be admitted again."""
    return renewed(of)


def one(of: Loaded, recorder: Recorder, file: EvidenceFile) -> tuple[int, ...]:
    """Return the times of the parts of one admission, in ns, and their total."""
    of = fresh(of)
    journal, queue = Journal(recorder), InvocationQueue(of.bundle.mission)
    queue.release(START.monotonic_us)
    admission = Admission(of, journal, queue, RemainingLatency())
    state = flat.state()
    begin = perf_counter_ns()
    answer = admission.ask(START, state, Ref(0, 0, -1))
    decided = perf_counter_ns()
    for action in journal.take(START, ended=False):
        if isinstance(action, Append):
            file.append(action.line, min(action.durability, WRITTEN))
    appended = perf_counter_ns()
    assert answer is not None
    dispatch = of.executor.dispatch(answer.permit, START.monotonic_us)
    end = perf_counter_ns()
    assert isinstance(dispatch, Command)
    return decided - begin, appended - decided, end - appended, end - begin


def main() -> int:
    """Measure and print; return 1 if a limit is missed."""
    survey = replace(flat.INVOCATIONS[flat.INSPECTION_STEP], step=0)
    of = loaded(mission=replace(flat.MISSION, invocations=(survey,)))
    recorder = Recorder(lambda text: LOG_KEY.sign(text, duty=Duty.LOG), LOG_KEY.public, lambda: bytes(32))
    recorder.genesis(START, bundle=b"", root=b"", boot=bytes(16), vehicle="quad-07", mission="m", mode="software")
    with TemporaryDirectory() as folder:
        file = EvidenceFile(Path(folder) / "log")
        [one(of, recorder, file) for _ in range(ROUNDS)]  # warm
        blocks = [[one(of, recorder, file) for _ in range(ROUNDS)] for _ in range(BLOCKS)]
        file.close()
    p95 = 0.0
    for number, name in enumerate(PARTS):
        columns = [sorted(parts[number] for parts in block) for block in blocks]
        middles, highs = ([column[at] / 1e3 for column in columns] for at in (ROUNDS // 2, ROUNDS * 95 // 100))
        p95 = min(highs)
        print(
            f"enforce: {name}: median {min(middles):.1f} us, p95 {p95:.1f} us "
            f"(median block: {median(middles):.1f} us, {median(highs):.1f} us)"
        )
    print(
        f"enforce: p95 is {p95 / LIMIT_US:.2f} of the limit ({LIMIT_US:.0f} us), "
        f"{p95 / PUBLISHED_US:.2f} of the published {PUBLISHED_US:.0f} us"
    )
    return int(p95 > LIMIT_US)


if __name__ == "__main__":
    sys.exit(main())
