"""The headline claims of the paper, and our targets, judged by the raw results.

A claim holds only if all of its runs are there. One run that contradicts it is enough to fail it; where some runs are
missing it is incomplete. A failed claim makes the exit code 1; a missed target does not.
"""

from collections.abc import Iterable, Iterator, Sequence
from enum import StrEnum
from statistics import median
from typing import Final, NamedTuple

from rtshcua.evaluation.case_flights import FLAVOURS, ON_GROUND
from rtshcua.evaluation.cases import CASES as MEASURED_CASES
from rtshcua.evaluation.design import MISSIONS, MODES, POINTS, RUNS, STEPS, UNENFORCED
from rtshcua.evaluation.measures import PAIRED, FlightTable, end_to_end, fallbacks, misses, p95, validation
from rtshcua.evaluation.published import CASES, FIGURES, FLAT, MICROSECONDS
from rtshcua.evaluation.results import (
    AppendTiming,
    CaseFlight,
    EnforceCheck,
    FallbackTiming,
    PointFlight,
    Result,
    UnavailableMode,
    VerificationTiming,
)

#: how many records a log has for the claims about evidence, as in the paper
RECORDS: Final = 1000


class ClaimVerdict(StrEnum):
    """What the results say of a claim or target."""

    HELD = "held"
    MISSED = "missed"
    INCOMPLETE = "incomplete"
    NOT_MEASURED = "not measured"
    NOT_AVAILABLE = "not available here"


class HeadlineClaim(NamedTuple):
    """A headline claim: what the paper says, what was measured, and on how many of the planned runs that rests."""

    slug: str
    text: str
    published: str
    measured: str
    runs: int
    planned: int
    verdict: ClaimVerdict


class Target(NamedTuple):
    """A tenth of a published figure, or of the lower end of a range, in `unit`; `stated` is the figure as the paper
    writes it. `measured` is there also where only a part was measured.
    """

    slug: str
    text: str
    stated: str
    published: float
    limit: float
    measured: float | None
    unit: str
    runs: int
    planned: int
    verdict: ClaimVerdict


class Claims(NamedTuple):
    """All headline claims and targets."""

    claims: tuple[HeadlineClaim, ...]
    targets: tuple[Target, ...]

    @property
    def failed(self) -> tuple[HeadlineClaim, ...]:
        """The headline claims that the results contradict."""
        return tuple(each for each in self.claims if each.verdict is ClaimVerdict.MISSED)

    @property
    def style(self) -> str:
        """How the verdict on all headline claims looks: `held` only where every claim is."""
        held = all(each.verdict is ClaimVerdict.HELD for each in self.claims)
        return "missed" if self.failed else "held" if held else "open"


def judge(results: Iterable[Result]) -> Claims:
    """Judge the headline claims and the targets."""
    kept = tuple(results)
    flights = FlightTable(kept)
    absent = set(absent_modes(kept))
    claims = (*_dispatched(kept, flights, absent), *_flat(flights, absent), *_decided(kept, absent), *_evidence(kept))
    return Claims(claims, tuple(_targets(kept, flights, absent)))


def absent_modes(results: Iterable[Result]) -> dict[str, str]:
    """The modes that are not available, and why: those of which nothing was measured."""
    kept = tuple(results)
    there = {each.mode for each in kept if isinstance(each, PointFlight | EnforceCheck | FallbackTiming)}
    return {each.mode: each.why for each in kept if isinstance(each, UnavailableMode) and each.mode not in there}


def is_undisturbed(flight: PointFlight) -> bool:
    """Whether a flight of X1 completed its mission without a missed deadline and without a fallback: by what it counts,
    and by each of its steps.
    """
    steps = {each.step for each in flight.invocations if each.outcome == "allow"}
    whole = steps == {*range(STEPS.get(flight.mission, 0))} and len(flight.invocations) == len(steps) > 0
    return whole and flight.ending == "completed" and not misses(flight) and not fallbacks(flight)


_EXPECTED: Final = {case.name: (case.outcome, case.reason) for case in CASES}


def passes(check: EnforceCheck) -> bool:
    """Whether a check of X3 agrees with the pure decision, and has the outcome and the reason of the table: by what it
    says of itself, and by the table.
    """
    return check.as_expected and check.agrees and _EXPECTED.get(check.case) == (check.outcome, check.reason)


def _verdict(runs: int, complete: bool, right: bool, absent: bool) -> ClaimVerdict:
    """The verdict by what is there: absence counts only where nothing was measured."""
    if not right:
        return ClaimVerdict.MISSED
    if complete:
        return ClaimVerdict.HELD
    if runs:
        return ClaimVerdict.INCOMPLETE
    return ClaimVerdict.NOT_AVAILABLE if absent else ClaimVerdict.NOT_MEASURED


def _dispatched(results: Sequence[Result], flights: FlightTable, absent: set[str]) -> Iterator[HeadlineClaim]:
    """X1: no missed deadline and no fallback, in each mode. A repeated flight counts once, but its failure stays."""
    failures: dict[str, list[PointFlight]] = {mode: [] for mode in MODES}
    for each in results:
        if isinstance(each, PointFlight) and each.mode in failures and not is_undisturbed(each):
            failures[each.mode].append(each)
    for mode in MODES:
        runs, wrong = len(flights.flights(mode)), failures[mode]
        late, fell = sum(map(misses, wrong)), sum(map(fallbacks, wrong))
        yield HeadlineClaim(
            f"x1/{mode}",
            f"X1, `{mode}`: no missed deadlines and no fallbacks; all flights complete",
            "0 and 0 in 1,890 flights of three modes",
            f"{late} and {fell}; disturbed flights: {len(wrong)}" if runs else "",
            runs,
            len(POINTS) * RUNS,
            _verdict(runs, flights.complete(mode), not wrong, mode in absent),
        )


_TWELVE: Final = frozenset(case.name for case in CASES if not case.extra)
_FURTHER: Final = frozenset(case.name for case in CASES if case.extra)


def _decided(results: Sequence[Result], absent: set[str]) -> Iterator[HeadlineClaim]:
    """X3: the twelve cases in each mode, the two further cases, and the whole runtime."""
    modes = tuple(mode for mode in MODES if mode != UNENFORCED)
    checks = [each for each in results if isinstance(each, EnforceCheck) and each.mode in modes]
    for mode in modes:
        mine = [each for each in checks if each.mode == mode and each.case in _TWELVE]
        text = f"X3, `{mode}`: decisions as expected, and equal to the reference"
        yield _checked(f"x3/{mode}", text, mine, len(_TWELVE), (mode,), absent)
    there = tuple(mode for mode in modes if mode not in absent)
    more = [each for each in checks if each.case in _FURTHER]
    yield _checked("x3/extra", "X3: the two further cases, in each available mode", more, len(_FURTHER), there, absent)
    yield _flown(results)


def _flown(results: Sequence[Result]) -> HeadlineClaim:
    """X3: the cases through the whole runtime: each with each autopilot, in the air and, where that is possible, on the
    ground.
    """
    flown = [each for each in results if isinstance(each, CaseFlight)]
    good = sum(each.holds for each in flown)
    planned = {(case.name, flavour, True) for case in MEASURED_CASES for flavour in FLAVOURS}
    planned |= {(case.name, flavour, False) for case in ON_GROUND for flavour in FLAVOURS}
    there = planned & {(each.case, each.flavour, each.aloft) for each in flown}
    return HeadlineClaim(
        "x3/runtime",
        "X3, whole runtime: what is dispatched follows each case, with each autopilot",
        "not published",
        f"{good:,} of {len(flown):,} flights" if flown else "",
        len(there),
        len(planned),
        _verdict(len(flown), there == planned, good == len(flown), absent=False),
    )


def _checked(
    slug: str, text: str, checks: Sequence[EnforceCheck], cases: int, modes: tuple[str, ...], absent: set[str]
) -> HeadlineClaim:
    """One claim about checks, all of which must pass."""
    counted: dict[tuple[str, str, str, int], set[int]] = {}
    for each in checks:
        cell = (each.mode, each.case, each.mission, each.deadline_us)
        counted.setdefault(cell, set()).add(each.repetition)
    runs, right = sum(map(len, counted.values())), sum(map(passes, checks))
    cells = cases * len(POINTS) * len(modes)
    complete = bool(cells) and len(counted) >= cells and all(len(seen) >= RUNS for seen in counted.values())
    return HeadlineClaim(
        slug,
        text,
        "not published" if slug == "x3/extra" else "7,560 of 7,560 in two modes",
        f"{right:,} of {len(checks):,}" if checks else "",
        runs,
        cells * RUNS,
        _verdict(runs, complete, right == len(checks), not set(modes) - absent),
    )


def _flat(flights: FlightTable, absent: set[str]) -> Iterator[HeadlineClaim]:
    """X2: the overhead does not grow with the length of a mission. The baseline has none, so it claims nothing."""
    for mode in [each for each in MODES if each != UNENFORCED]:
        key = f"x2/median/{{}}/{mode}"
        stated = [FIGURES[key.format(mission)].low for mission in MISSIONS if key.format(mission) in FIGURES]
        runs, ratio, complete = len(flights.flights(mode)), flights.flatness(mode), flights.complete(mode)
        yield HeadlineClaim(
            f"x2/{mode}",
            f"X2, `{mode}`: median end-to-end flat over 3, 6 and 12 steps (largest/smallest at most {FLAT})",
            f"{max(stated) / min(stated):.2f} [D]" if stated else "not published",
            "" if ratio is None else f"{ratio:.2f}",
            runs,
            len(POINTS) * RUNS,
            # a ratio of a few flights says nothing, for or against
            _verdict(runs, complete, not complete or ratio is None or ratio <= FLAT, mode in absent),
        )


def _evidence(results: Sequence[Result]) -> Iterator[HeadlineClaim]:
    """X6: evidence costs microseconds."""
    for slug, text, published, found in (
        ("x6/append", "append, `written`, median", "x6/append-median", appended_us(results)),
        ("x6/verification", "verification of a record, default, median", "x6/verification", verified_us(results)),
    ):
        logs, took_us = found
        yield HeadlineClaim(
            slug,
            f"X6: {text}, at most {MICROSECONDS} us",
            f"{FIGURES[published].text} us",
            "" if took_us is None else f"{took_us:.3g} us",
            logs,
            RUNS,
            _verdict(logs, logs >= RUNS, took_us is None or took_us <= MICROSECONDS, absent=False),
        )


def appended_us(results: Iterable[Result], durability: str = "written") -> tuple[int, float | None]:
    """Return the number of logs of `RECORDS` records, and their median append in us."""
    logs = [
        each.appended_ns
        for each in results
        if isinstance(each, AppendTiming) and each.durability == durability and len(each.appended_ns) == RECORDS
    ]
    return len(logs), median(took for log in logs for took in log) / 1e3 if logs else None


def verified_us(results: Iterable[Result], way: str = "default") -> tuple[int, float | None]:
    """Return the number of verifications of `RECORDS` records, and the median time of a record in us, without those
    that had to open the bundle.
    """
    took = [
        each.took_ns / each.records
        for each in results
        if isinstance(each, VerificationTiming) and each.way == way and each.records == RECORDS and not each.cold
    ]
    return len(took), median(took) / 1e3 if took else None


def _targets(results: Sequence[Result], flights: FlightTable, absent: set[str]) -> Iterator[Target]:
    """Each figure that is to be a tenth of the published one."""
    planned, software = len(POINTS) * RUNS, "software"
    runs, complete = len(flights.flights(software)), flights.complete(software)
    for mission in MISSIONS:
        found = flights.average(software, mission, end_to_end, p95)
        yield _target(
            f"end-to-end/{mission}", f"P95 end-to-end, `{mission}`, `{software}`", f"x1/p95/{mission}/{software}",
            found and found.mean / 1e6, (runs, planned, complete),
        )  # fmt: skip
    worst = [flights.average(software, mission, validation, p95) for mission in MISSIONS]
    yield _target(
        "validation", f"P95 validation, `{software}`, the greatest of the missions", f"x2/validation/{software}",
        max((each.mean / 1e6 for each in worst if each), default=None), (runs, planned, complete),
    )  # fmt: skip
    yield _fallback_target(results)
    for slug, text, key, measured in (
        ("append", "median append, `written`", "x6/append-median", appended_us(results)),
        ("verification", "verification of a record, default", "x6/verification", verified_us(results)),
    ):
        yield _target(slug, text, key, measured[1], (measured[0], RUNS, measured[0] >= RUNS))
    _, of, by = PAIRED[0]
    for slug, base, told in (
        ("isolation", software, "`software` (in Python)"),
        ("isolation-in-c", "process", "`process` (the same C)"),
    ):
        added, mode = flights.added_average("optee", base, None, of, by), "optee"
        yield _target(
            slug, f"validation that `optee` adds to {told}, median", "x5/validation-median",
            added and added.mean / 1e6,
            (len(flights.flights(mode)), planned, flights.complete(mode) and flights.complete(base)), mode in absent,
        )  # fmt: skip


def _fallback_target(results: Sequence[Result]) -> Target:
    """X4: the slowest condition's median."""
    conditions = {case.name for case in CASES if case.outcome != "allow" and not case.extra}
    took: dict[str, list[int]] = {}
    for each in results:
        if isinstance(each, FallbackTiming) and each.mode == "software" and each.case in conditions:
            took.setdefault(each.case, []).append(each.local_ns)
    there = [took.get(case, []) for case in conditions]
    return _target(
        "fallback", "fallback, `software`, the greatest median of a condition", "x4/median",
        max((median(values) / 1e6 for values in took.values()), default=None),
        (sum(map(len, took.values())), len(conditions) * RUNS, all(len(values) >= RUNS for values in there)),
    )  # fmt: skip


def _target(
    slug: str, text: str, key: str, measured: float | None, rests: tuple[int, int, bool], absent: bool = False
) -> Target:
    """One target: a tenth of the lower end of the published figure. `rests`: runs, planned runs, and whether all of
    them are there.
    """
    figure, (runs, planned, complete) = FIGURES[key], rests
    limit = figure.low / 10
    right = not complete or measured is None or measured <= limit
    verdict = _verdict(runs, complete and measured is not None, right, absent)
    return Target(slug, text, figure.text, figure.low, limit, measured, figure.unit, runs, planned, verdict)
