"""X6: what evidence costs. The append of each record of a log by durability, and the verification of a log in four
ways, each for the published 1,000 records and for a long log.

An append is all of the runtime's work on a record and its place in the file: the record, its encoding, the chain, the
tree and the write. The paper does not say whether its append includes a sync, nor what its verification checks: the
comparable pair is `written` and `default`. A seal, after 1,024 records, counts as one of them.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter_ns
from typing import Final

from msgspec.structs import replace

from rtshcua.adapters.store.evidence_file import EvidenceFile
from rtshcua.adapters.store.reading import open_regular
from rtshcua.adapters.store.verification import VerificationInputs, verify_carefully, verify_quickly
from rtshcua.decision.decide import decide
from rtshcua.evaluation.case_checks import Prepared
from rtshcua.evaluation.cases import admissible
from rtshcua.evaluation.design import WARM_APPENDS, EvaluationPlan, EvaluationPoint, WorkUnit
from rtshcua.evaluation.results import AppendTiming, Result, VerificationTiming
from rtshcua.evaluation.worlds import ISSUED_US, RECEIVED, FlatProgram, bound, pinned, program_at
from rtshcua.evidence.log_writer import Recorder
from rtshcua.evidence.report import LogVerdict
from rtshcua.ground.audit.audit import Audit
from rtshcua.ground.audit.trust import forget
from rtshcua.model.durability import BUFFERED, SYNCED_FIRST, WRITTEN
from rtshcua.model.flat.situation import Context, Now
from rtshcua.onboard.enforcement.load import EnforcementMode
from rtshcua.virtual import development_keys
from rtshcua.wire.keys import Duty
from rtshcua.wire.request import STEP, Ref
from rtshcua.wire.trust import open_root

NAME: Final = "X6"
#: records of a log: as published, and of long ones
RECORDS: Final = 1_000
LONG, LONG_QUICK = 262_144, 5_000
#: how often a long log is verified each way
LONG_RUNS: Final = 3
DURABILITIES: Final = {"buffered": BUFFERED, "written": WRITTEN, "synced-first": SYNCED_FIRST}
#: verifications by name, as options of `verify-log`: `--fast`, none, `--audit --no-derive`, `--audit`
WAYS: Final[dict[str, Callable[[Path, VerificationInputs], Audit]]] = {
    "fast": lambda path, inputs: verify_quickly(path, inputs, fast=True, jobs=1),
    "default": lambda path, inputs: verify_quickly(path, inputs, jobs=1),
    "audit-no-derive": lambda path, inputs: verify_carefully(path, inputs, derive=False),
    "audit": lambda path, inputs: verify_carefully(path, inputs, derive=True),
}
#: the mission whose first step is decided again and again, and the time between two decisions in us
_POINT: Final = EvaluationPoint("standard", 1_000_000)
_APART_US: Final = 700


def units(plan: EvaluationPlan) -> list[WorkUnit]:
    """The appends of each durability, a unit for each log, then one with all verifications of a log of each length.

    A long log is not synced record by record: that takes as long as its disk.
    """
    long = LONG_QUICK if plan.quick else LONG
    appends = [("append", name, RECORDS, each) for name in DURABILITIES for each in range(1, plan.runs + 1)]
    appends += [("append", name, long, 1) for name in DURABILITIES if name != "synced-first"]
    verifications = [("verification", "", RECORDS, plan.runs), ("verification", "", long, min(plan.runs, LONG_RUNS))]
    return [WorkUnit(NAME, key) for key in (*appends, *verifications)]


def run(unit: WorkUnit) -> Sequence[Result]:
    """Measure a unit. Raises RuntimeError where a log is not verified."""
    what, durability, records, number = unit.key
    log = _Log(program_at(_POINT))
    with TemporaryDirectory(prefix="evidence-") as folder:
        path = Path(folder) / "log.jsonl"
        if what == "append":  # all records but the first, which opens the log
            log.write(Path(folder) / "warm.jsonl", WARM_APPENDS, WRITTEN)
            took_ns = log.write(path, int(records) + 1, DURABILITIES[str(durability)])
            with open_regular(path) as file:
                octets = path.stat().st_size - len(file.readline())
            return [
                AppendTiming(durability=str(durability), repetition=int(number), octets=octets, appended_ns=took_ns)
            ]
        log.write(path, int(records), WRITTEN)
        return [*_verified(path, int(records), int(number))]


def _verified(path: Path, records: int, runs: int) -> Iterator[VerificationTiming]:
    """Each way in turns, and before it, for the published length, the same without a bundle that was opened before."""
    inputs = VerificationInputs(pinned())
    if records > RECORDS:
        WAYS["fast"](path, inputs)  # opens the bundle
    for repetition in range(1, runs + 1):
        for way in WAYS:
            for cold in (True, False) if records <= RECORDS else (False,):
                if cold:
                    forget()
                took_ns = _verification_ns(path, records, way, inputs)
                yield VerificationTiming(way=way, records=records, repetition=repetition, took_ns=took_ns, cold=cold)


def _verification_ns(path: Path, records: int, way: str, inputs: VerificationInputs) -> int:
    start_ns = perf_counter_ns()
    report = WAYS[way](path, inputs).report
    took_ns = perf_counter_ns() - start_ns
    if report.verdict is not LogVerdict.VERIFIED or report.records != records:
        raise RuntimeError(f"`{way}` of {records} records: {report.failure or report.shortfall}")
    return took_ns


def _root() -> bytes:
    """A trust root without a key of the boundary, which would have to sign what it decided: nothing decides here."""
    keys = {duty: key for duty, key in development_keys.keys().items() if duty is not Duty.BOUNDARY}
    signed = open_root(development_keys.root(ISSUED_US, ()), pinned=pinned(), now_us=RECEIVED.utc_us)
    known = {key.kid for key in keys.values()}
    return replace(signed, keys=tuple(each for each in signed.keys if each.kid in known)).sign(keys[Duty.ROOT])


class _Log:
    """Logs of which half are decisions, with their inputs, result and reason, and half events, so that a record is
    about as long on average as in logs of flights. The same step is decided again and again: it is deferred, so that
    it may be asked again.
    """

    def __init__(self, program: FlatProgram) -> None:
        policy, self._mission = program
        self._policy, steps = Prepared.of(policy, bound(program))
        self._bundle, self._root = development_keys.seal(*program), _root()
        self._step = step = steps[0]
        usual = admissible(policy, self._mission.invocations, 0)
        fix = next(each.slot for each in policy.signals if each.name == "gps.fix")
        self._state = replace(usual, values=tuple(None if at == fix else each for at, each in enumerate(usual.values)))
        self._asked = Context(
            step.invocation.binding, policy.vehicle.identity, policy.version, 0, 0, step.invocation.phase, 12_000, ()
        )
        self._answer = decide(step, self._state, self._policy, self._context(RECEIVED), RECEIVED)

    def _context(self, now: Now) -> Context:
        return replace(self._asked, released_us=now.monotonic_us)

    def write(self, path: Path, records: int, durability: int) -> tuple[int, ...]:
        """Write a log of so many records; returns the duration of each append after the first record, in ns, with the
        seals, which are records too.
        """
        keys, seeds = development_keys.keys(), count(1)
        recorder = Recorder(
            lambda text: keys[Duty.LOG].sign(text, duty=Duty.LOG), keys[Duty.LOG].public,
            lambda: next(seeds).to_bytes(32),
        )  # fmt: skip
        genesis = recorder.genesis(
            RECEIVED, bundle=self._bundle, root=self._root, boot=bytes(16), vehicle=self._asked.vehicle,
            mission=self._mission.name, mode=EnforcementMode.SOFTWARE,
        )  # fmt: skip
        file = EvidenceFile(path)
        file.append(genesis, SYNCED_FIRST)
        took_ns = []
        for number in range(1, records):
            gone_us = number * _APART_US
            now = Now(RECEIVED.monotonic_us + gone_us, RECEIVED.utc_us + gone_us, RECEIVED.utc_error_us)
            start_ns = perf_counter_ns()
            file.append(self._line(recorder, now, number, last=number == records - 1), durability)
            took_ns.append(perf_counter_ns() - start_ns)
        file.close()
        return tuple(took_ns)

    def _line(self, recorder: Recorder, now: Now, number: int, *, last: bool) -> bytes:
        if last:
            return recorder.close(now, ending="completed", tlog=None)
        if recorder.due(now):
            return recorder.seal(now)
        if number % 2:
            return recorder.effect(now, "said", Ref(STEP, 0, -1), token=1, detail="6: PreArm: waiting for a 3D fix")
        answer = replace(self._answer, valid_until_us=now.monotonic_us)
        invocation = self._step.invocation
        return recorder.decision(
            now, Ref(STEP, 0, -1), invocation.invocation_id, self._state, self._context(now), answer, WRITTEN
        )
