"""Raw results of the evaluation as a seeded generator makes them, and a campaign: for tests of claims and report."""

from collections.abc import Iterator, Sequence
from random import Random
from typing import Final

from rtshcua.campaign.campaign_report import CampaignSummary, summarise
from rtshcua.campaign.rounds import CampaignResult, JudgeFinding
from rtshcua.evaluation.computer import Computer
from rtshcua.evaluation.design import MODES, POINTS, RUNS, UNENFORCED, EvaluationPoint
from rtshcua.evaluation.fallback_flights import FLOWN
from rtshcua.evaluation.published import CASES
from rtshcua.evaluation.results import (
    AppendTiming,
    CaseFlight,
    ComponentSize,
    EnforceCheck,
    FallbackReaction,
    FallbackTiming,
    PointFlight,
    Result,
    StepTiming,
    UnavailableMode,
    VerificationTiming,
)

STEPS: Final = {"short": 3, "standard": 6, "extended": 12}
#: ns
VALIDATION: Final = {
    "none": 30_000, UNENFORCED: 9_000, "software": 31_000, "process": 110_000, "trustzone-m": 190_000,
    "optee": 5_100_000,
}  # fmt: skip
COMPUTER: Final = Computer(
    processor="A processor", cores=2, memory=8 << 30, system="Debian GNU/Linux, Linux 6.1", python="CPython 3.12.1",
    program="0.1.0", commit="0123456789abcdef0123456789abcdef01234567",
    versions={"cryptography": "45.0.0", "msgspec": "0.19.0"}, load=(1.5, 2.0, 2.25),
)  # fmt: skip


def flight(mission: str, deadline_us: int, mode: str, seed: int, chance: Random | None = None) -> PointFlight:
    """An undisturbed flight."""
    chance = chance or Random(f"{mission} {deadline_us} {mode} {seed}")
    steps = []
    for step in range(STEPS[mission]):
        validation = round(VALIDATION[mode] * chance.uniform(0.9, 1.3))
        dispatch, rest = round(60_000 * chance.uniform(0.8, 1.5)), round(700_000 * chance.uniform(0.7, 2.0))
        steps.append(
            StepTiming(
                step=step, outcome="allow", reason="admitted", validation_ns=validation,
                end_to_end_ns=validation + dispatch + rest, dispatch_ns=dispatch,
            )
        )  # fmt: skip
    return PointFlight(
        mission=mission, deadline_us=deadline_us, mode=mode, seed=seed, ending="completed", misses=0, fallbacks=0,
        proposal_ns=round(90e6 * chance.uniform(0.9, 1.2)), invocations=tuple(steps),
    )  # fmt: skip


def flights(
    modes: Sequence[str] = MODES, points: Sequence[EvaluationPoint] = POINTS, runs: int = RUNS
) -> Iterator[PointFlight]:
    """The flights of X1."""
    for mode in modes:
        for point in points:
            for seed in range(1, runs + 1):
                yield flight(*point, mode, seed)


def checks(
    modes: Sequence[str] = MODES, points: Sequence[EvaluationPoint] = POINTS, runs: int = RUNS
) -> Iterator[EnforceCheck]:
    """The checks of X3, which all pass."""
    for mode in modes:
        if mode == UNENFORCED:
            continue
        for point in points:
            for case in CASES:
                for repetition in range(1, runs + 1):
                    yield EnforceCheck(
                        case=case.name, mission=point.mission, deadline_us=point.deadline_us, mode=mode,
                        repetition=repetition, outcome=case.outcome, reason=case.reason, as_expected=True, agrees=True,
                        permits=int(case.outcome == "allow" or mode == "none"),
                    )  # fmt: skip


def case_flights(point: EvaluationPoint = POINTS[0]) -> Iterator[CaseFlight]:
    """The cases through the whole runtime, in the air and on the ground, which all hold."""
    for case in CASES:
        for flavour in () if case.extra else ("px4", "ardupilot"):
            for aloft in (True, False):
                yield CaseFlight(
                    case=case.name, mission=point.mission, deadline_us=point.deadline_us, flavour=flavour, seed=1,
                    aloft=aloft, expected="the skill" if case.outcome == "allow" else "the first admissible link",
                    dispatched=("hover",), ending="completed" if case.outcome == "allow" else "aborted", holds=True,
                )  # fmt: skip


def timings(runs: int = RUNS) -> Iterator[Result]:
    """X4 and X6."""
    chance = Random(4)
    for case in CASES:
        if case.outcome != "allow":
            for repetition in range(1, runs + 1):
                local = round(60_000 * chance.uniform(0.9, 1.4))
                yield FallbackTiming(
                    case=case.name, mode="software", repetition=repetition, local_ns=local, written_ns=local + 5_000,
                    synced_ns=local + 900_000,
                )  # fmt: skip
    for case in FLOWN:
        for repetition in range(1, runs + 1):
            took = round(600_000 * chance.uniform(0.9, 1.4))
            yield FallbackReaction(case=case, mode="software", repetition=repetition, took_ns=took)
    for durability, most in (("buffered", 2_000), ("written", 4_000), ("synced-first", 700_000)):
        for repetition in range(1, runs + 1):
            appended = tuple(round(most * chance.uniform(0.8, 1.6)) for _ in range(1000))
            yield AppendTiming(durability=durability, repetition=repetition, octets=570_000, appended_ns=appended)
    for way, each in (("fast", 1_060), ("default", 1_390), ("audit-no-derive", 10_900), ("audit", 31_100)):
        for repetition in range(1, runs + 1):
            for cold in (True, False):
                took = (each + 14_000 * cold) * 1000
                yield VerificationTiming(way=way, records=1000, repetition=repetition, took_ns=took, cold=cold)


def sizes() -> Iterator[ComponentSize]:
    """X7."""
    yield ComponentSize(
        component="runtime dispatcher", domain="companion", files=("onboard/runtime",), code_lines=986,
        artifact=60_109, memory=15_000, state="-",
    )  # fmt: skip
    yield ComponentSize(
        component="trusted enforcement: optee", domain="secure-world", files=("boundary",), code_lines=None,
        artifact=130_000, memory=None, state="keys, ids, chain",
    )  # fmt: skip


def everything(runs: int = RUNS) -> Iterator[Result]:
    """Results of all experiments; this computer has no `optee`."""
    modes = [mode for mode in MODES if mode != "optee"]
    yield from flights(modes, runs=runs)
    yield from checks(modes, runs=runs)
    yield from case_flights()
    yield from timings(runs)
    yield from sizes()
    yield UnavailableMode(mode="optee", why="qemu-system-aarch64 is not installed")


def campaign() -> CampaignSummary:
    """The summary of a campaign of twelve flights, one of which failed."""
    results = {}
    for number in range(12):
        failures = (JudgeFinding("late", "a motion frame was sent 12 ms late"),) if number == 7 else ()
        excused = (JudgeFinding("collision", "hit an obstacle", why="the obstacle was not reported"),) * (number == 3)
        results[number] = CampaignResult(
            number=number, flavour=("px4", "ardupilot")[number % 2], seed=number, incidents=("a gust",), tries=(),
            ending=("completed", "aborted", "stood-down")[number % 3], failures=failures, exceptions=excused,
            margins={"fence_mm": 9_000 - 300 * number, "stop_us": 2_000 + number}, moments=(), flown_us=60_000_000,
            log="",
        )  # fmt: skip
    return summarise("short", 1, results, {})
