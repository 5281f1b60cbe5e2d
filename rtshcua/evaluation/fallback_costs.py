"""X4: what an answer to trouble costs on board, without vehicle and network: for each case that is not allowed, from
the encoding of the request to the line of evidence, and on to the file and the disk. `fallback_flights` has the
way from frame to frame.

`local` is the request, the decision with the link that it selects, the answer, and the record of both with its place in
chain and tree. Each boundary is asked by the octets of a request, and the cases take turns. The runs that are synced
follow those that are not: after a sync the processor's caches are cold.
"""

import gc
from collections.abc import Iterator, Sequence
from itertools import count
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from time import perf_counter_ns
from typing import Final

from rtshcua.adapters.store.evidence_file import EvidenceFile
from rtshcua.evaluation import cases
from rtshcua.evaluation.case_checks import SLOW, StruckBundle
from rtshcua.evaluation.cases import CASES, EvaluationCase
from rtshcua.evaluation.design import WARM_ROUNDS, EvaluationPlan, EvaluationPoint, WorkUnit
from rtshcua.evaluation.fallback_flights import FLOWN, reactions
from rtshcua.evaluation.results import FallbackTiming, Result
from rtshcua.evaluation.worlds import RECEIVED, World, not_here, program_at, root_of, world
from rtshcua.evidence.log_writer import Recorder
from rtshcua.model.decision import Decision
from rtshcua.model.durability import SYNCED_FIRST, WRITTEN
from rtshcua.model.flat.situation import Context
from rtshcua.model.outcome import Outcome
from rtshcua.virtual import development_keys
from rtshcua.wire.keys import Duty
from rtshcua.wire.request import Request, encode

NAME: Final = "X4"
#: the first part of the key of a unit of flights
REACTION: Final = "reaction"
#: modes in which all is enforced
ENFORCED: Final = ("software", "process", "trustzone-m", "optee")
#: every case that is not allowed
TRIGGERED: Final = tuple(each for each in CASES if each.outcome is not Outcome.ALLOW)
_POINT: Final = EvaluationPoint("standard", 1_000_000)


def units(plan: EvaluationPlan) -> list[WorkUnit]:
    """One unit for each mode, with all conditions; then the flights, one unit for each mode (`quick`: of one only) and
    condition.
    """
    modes = [mode for mode in plan.modes if mode in ENFORCED and not (plan.quick and mode in SLOW)]
    flown = [
        WorkUnit(NAME, (REACTION, case, mode, plan.runs))
        for mode in modes[: 1 if plan.quick else None]
        for case in FLOWN
    ]
    return [*(WorkUnit(NAME, (mode, plan.runs)) for mode in modes), *flown]


def run(unit: WorkUnit) -> Sequence[Result]:
    """Measure a unit. Raises RuntimeError for an unexpected outcome."""
    *flown, mode, runs = unit.key
    missing = not_here(str(mode))
    if missing:
        return missing
    if flown:
        return reactions(str(flown[1]), str(mode), int(runs))
    program, found = program_at(_POINT), list[Result]()
    own = (cases.OUT_OF_SCOPE, cases.NOT_PERMITTED)
    groups = ([each for each in TRIGGERED if each not in own], *([each] for each in own))
    with world(str(mode), program.policy) as where, TemporaryDirectory(prefix="fallbacks-") as folder:
        for number, group in enumerate(groups):
            subject = StruckBundle(where, cases.program_of(group[0], program))
            found += _measured(where, subject, group, int(runs), Path(folder) / f"{number}.jsonl")
    return found


def _measured(
    where: World, subject: StruckBundle, group: Sequence[EvaluationCase], runs: int, path: Path
) -> Iterator[FallbackTiming]:
    keys, seeds = development_keys.keys(), count(1)
    recorder = Recorder(
        lambda text: keys[Duty.LOG].sign(text, duty=Duty.LOG), keys[Duty.LOG].public, lambda: next(seeds).to_bytes(32)
    )
    policy = subject.loaded.policy.policy
    genesis = recorder.genesis(
        RECEIVED, bundle=b"", root=root_of(policy), boot=bytes(16), vehicle=subject.loaded.vehicle,
        mission=subject.mission.name, mode=where.mode,
    )  # fmt: skip
    file = EvidenceFile(path)
    file.append(genesis, SYNCED_FIRST)
    gc.collect()

    def once(case: EvaluationCase, repetition: int, *, sync: bool) -> tuple[int, int, int]:
        request = subject.request(case, Random(f"{case.name} {repetition}"))
        return _one(subject, case, request, recorder, file, sync=sync)

    took: dict[tuple[str, int], tuple[int, int]] = {}
    for repetition in range(1 - WARM_ROUNDS, runs + 1):
        for case in group:
            took[case.name, repetition] = once(case, repetition, sync=False)[:2]
    for repetition in range(1, runs + 1):
        for case in group:
            local_ns, written_ns = took[case.name, repetition]
            yield FallbackTiming(
                case=case.name, mode=where.mode, repetition=repetition, local_ns=local_ns, written_ns=written_ns,
                synced_ns=once(case, repetition, sync=True)[2],
            )  # fmt: skip
    file.close()


def _one(
    subject: StruckBundle, case: EvaluationCase, request: Request, recorder: Recorder, file: EvidenceFile, *, sync: bool
) -> tuple[int, int, int]:
    """How long one answer takes, in ns: until its line is made, is in the file and, with `sync`, on the disk."""
    identity, vehicle = subject.mission.invocations[request.step].invocation_id, subject.loaded.vehicle
    version = subject.loaded.policy.policy.version
    start_ns = perf_counter_ns()
    answer = subject.answer(encode(request))
    if not isinstance(answer, Decision) or (answer.outcome, answer.reason) != (case.outcome, case.reason):
        raise RuntimeError(f"{case.name}: {answer}")
    context = Context(
        request.binding, vehicle, version, answer.consumed, request.released_us, request.phase, request.remaining_us, ()
    )
    line = recorder.decision(request.now, request.ref, identity, request.state, context, answer, WRITTEN)
    made_ns = perf_counter_ns()
    file.append(line, WRITTEN)
    written_ns = perf_counter_ns()
    if sync:
        file.sync()
    synced_ns = perf_counter_ns()
    subject.note(answer)
    return made_ns - start_ns, written_ns - start_ns, synced_ns - start_ns
