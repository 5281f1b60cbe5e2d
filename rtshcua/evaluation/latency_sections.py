"""The report's sections about latency: X1, X2, X4 and X5."""

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from itertools import chain
from statistics import median
from typing import Final, NamedTuple

from rtshcua.evaluation.design import DEADLINES_US, MISSIONS, MODES, POINTS
from rtshcua.evaluation.fallback_flights import revealed_by
from rtshcua.evaluation.headline_claims import is_undisturbed
from rtshcua.evaluation.measures import (
    PAIRED,
    Averaged,
    Distribution,
    Durations,
    Reduction,
    dispatch,
    distribution,
    end_to_end,
    fallbacks,
    misses,
    p95,
    proposal,
    remaining,
    validation,
)
from rtshcua.evaluation.published import CASES, FIGURES, PUBLISHED_MODES, PublishedFigure
from rtshcua.evaluation.report_parts import (
    NONE,
    Measured,
    ReportChart,
    ReportRow,
    ReportSection,
    ReportTable,
    case_order,
    columns,
    digits,
    ms,
    ordered_modes,
    span,
)
from rtshcua.evaluation.results import FallbackReaction, FallbackTiming, PointFlight
from rtshcua.ground.drawing.bar_chart import ChartBar, ChartGroup, bar_chart

#: the isolated modes, which decide in C; those after the first are compared with it too
ISOLATED: Final = ("process", "trustzone-m", "optee")
_WHISKERS: Final = "Bars are means over the seven deadlines, whiskers the least and the greatest of the seven."


class _Quantity(NamedTuple):
    """A latency by mission and mode, with the key of its published figures (`{mission}` and `{mode}`)."""

    title: str
    of: Durations
    by: Reduction
    key: str
    choices: tuple[str, ...]


_P95 = _Quantity(
    "P95 end-to-end",
    end_to_end,
    p95,
    "x1/p95/{mission}/{mode}",
    ("end-to-end", "clock", "percentile", "missions", "none"),
)
_MEDIAN = _Quantity(
    "Median end-to-end", end_to_end, median, "x2/median/{mission}/{mode}", ("end-to-end", "cell-average", "none")
)
_VALIDATION = _Quantity(
    "P95 validation", validation, p95, "x2/validation/{mode}", ("validation", "percentile", "cell-average", "none")
)


def normal_section(measured: Measured) -> ReportSection:
    """X1: the matrix of flights without trouble."""
    lead = (
        "Each mission is flown with each deadline, in each mode, 30 times, without any fault. The paper publishes the "
        "P95 of the end-to-end latency as the mean of the seven deadlines, and no value of a single deadline.",
    )
    parts = (*_compared(measured, _P95), _outcomes(measured), _proposals(measured))
    return ReportSection("x1", "X1: flights without trouble", lead, parts)


def scaling_section(measured: Measured) -> ReportSection:
    """X2: the same flights by the length of their mission."""
    lead = (
        "The flights of X1 by the length of the mission. Longer missions have more invocations; an invocation should "
        "not cost more.",
    )
    parts = (*_compared(measured, _MEDIAN), *_compared(measured, _VALIDATION), _flatness(measured), _shares(measured))
    return ReportSection("x2", "X2: scaling with the mission", lead, parts)


def _compared(measured: Measured, quantity: _Quantity) -> tuple[ReportTable, ReportChart]:
    """The table and the chart of a quantity: published and ours, by mission and mode."""
    rows: list[tuple[str, ...]] = []
    groups = []
    for mission in MISSIONS:
        bars = []
        for mode in MODES:
            stated = FIGURES.get(quantity.key.format(mission=mission, mode=mode))
            found = measured.flights.average(mode, mission, quantity.of, quantity.by)
            rows.append(
                (
                    f"{mission}, `{mode}`",
                    stated.text if stated else NONE,
                    *_ours(measured, mode, mission, quantity, stated),
                )
            )
            if stated:
                ends = (stated.low, stated.high) if stated.low < stated.high else (None, None)
                bars.append(ChartBar(f"paper, {mode}", stated.high, f"{stated.text} ms", "published", *ends))
            bars.append(_bar(measured, mode, mode, found))
        groups.append(ChartGroup(mission, tuple(bars)))
    ranged = "{mission}" not in quantity.key
    published = " (of each mission a value within the range, whose lower end is divided by ours)" if ranged else ""
    title = f"{quantity.title} in ms, by mission and mode"
    table = ReportTable(
        f"{title}: published{published} and measured",
        columns(
            "Mission, mode", "#Paper [P]", "#Ours", "#Least to greatest of the deadlines", "#Paper / ours", "#Flights"
        ),
        tuple(rows),
        quantity.choices,
    )
    chart = bar_chart(title, "The figures are those of the table above.", groups, logarithmic=True)
    return table, ReportChart(chart, f"{title}; logarithmic axis. Hatched: published. {_WHISKERS}")


def _ours(
    measured: Measured, mode: str, mission: str, quantity: _Quantity, stated: PublishedFigure | None
) -> tuple[str, str, str, str]:
    """Our columns: mean, whiskers, how many times below the paper, and flights."""
    found = measured.flights.average(mode, mission, quantity.of, quantity.by)
    flights = f"{sum(1 for _ in _of_mission(measured, mode, mission)):,}"
    if found is None:
        return measured.missing(mode), NONE, NONE, flights
    few = "" if found.cells == len(DEADLINES_US) else f" ({found.cells} of {len(DEADLINES_US)} deadlines)"
    below = NONE if stated is None or not found.mean else digits(stated.low / (found.mean / 1e6))
    return ms(found.mean), span(found) + few, below, flights


def _bar(measured: Measured, label: str, mode: str, found: Averaged | None) -> ChartBar:
    """Our bar, with whiskers."""
    if found is None:
        return ChartBar(label, None, measured.missing(mode), "ours")
    return ChartBar(label, found.mean / 1e6, f"{ms(found.mean)} ms", "ours", found.low / 1e6, found.high / 1e6)


def _outcomes(measured: Measured) -> ReportTable:
    """What became of the flights of X1, by mode."""
    rows: list[tuple[str, ...]] = []
    for mode in MODES:
        flights = measured.flights.flights(mode)
        if not flights:
            rows.append((f"`{mode}`", measured.missing(mode), *[NONE] * 7))
            continue
        said = Counter(each.outcome for flight in flights for each in flight.invocations)
        others = ", ".join(f"{count:,} {outcome}" for outcome, count in sorted(said.items()) if outcome != "allow")
        counts = (len(flights), sum(said.values()), sum(each.ending == "completed" for each in flights))
        bad = (sum(map(misses, flights)), sum(map(fallbacks, flights)))
        wrong = sum(not is_undisturbed(each) for each in flights)
        numbers = (f"{each:,}" for each in (*counts, *bad, wrong))
        rows.append((f"`{mode}`", *numbers, others or "none", _deferred(flights)))
    return ReportTable(
        "Flights of X1. The paper has 1,890 in three modes, with 0 misses and 0 fallbacks",
        columns(
            "Mode", "#Flights", "#Invocations", "#Completed", "#Deadline misses", "#Fallbacks", "#Disturbed flights",
            "Outcomes besides allow", "#Deferred before",
        ),
        tuple(rows),
        ("misses", "deadline", "reports", "repetitions", "modes"),
    )  # fmt: skip


def _deferred(flights: Sequence[PointFlight]) -> str:
    """How many answers deferred a step before its last one; nothing where some flight did not count them."""
    again = [each.asked_again for each in flights if each.asked_again is not None]
    return f"{sum(again):,}" if len(again) == len(flights) else NONE


def _proposals(measured: Measured) -> ReportTable:
    """The other reading of end-to-end."""
    rows: list[tuple[str, ...]] = []
    for mode in MODES:
        spreads = [
            distribution(chain.from_iterable(map(proposal, _of_mission(measured, mode, mission))))
            for mission in MISSIONS
        ]
        told = [NONE if each is None else f"{ms(each.median)} / {ms(each.p95)}" for each in spreads]
        rows.append((f"`{mode}`", *(told if any(spreads) else (measured.missing(mode), NONE, NONE))))
    return ReportTable(
        "The other reading of end-to-end, from the mission's text to the first command frame: median / P95 in ms",
        columns("Mode", *(f"#{mission}" for mission in MISSIONS)),
        tuple(rows),
        ("end-to-end",),
    )


def _of_mission(measured: Measured, mode: str, mission: str) -> Iterator[PointFlight]:
    return (each for each in measured.flights.flights(mode) if each.mission == mission)


def _flatness(measured: Measured) -> ReportTable:
    """The ratio of the largest to the smallest median."""
    rows: list[tuple[str, ...]] = []
    for mode in MODES:
        ours = measured.flights.flatness(mode)
        stated = [FIGURES[f"x2/median/{mission}/{mode}"].low for mission in MISSIONS if mode in PUBLISHED_MODES]
        ratio = f"{max(stated) / min(stated):.2f}" if stated else NONE
        rows.append((f"`{mode}`", ratio, measured.missing(mode) if ours is None else f"{ours:.2f}"))
    return ReportTable(
        "The largest of the three median end-to-end latencies divided by the smallest",
        columns("Mode", "#Paper [D]", "#Ours"),
        tuple(rows),
        ("flat",),
    )


def _shares(measured: Measured) -> ReportTable:
    """Where the time of an invocation goes."""
    rows: list[tuple[str, ...]] = []
    for mode in MODES:
        flights = measured.flights.flights(mode)
        found = [
            distribution(chain.from_iterable(map(of, flights))) for of in (end_to_end, remaining, validation, dispatch)
        ]
        told = [NONE if each is None else f"{ms(each.median)} / {ms(each.p95)}" for each in found]
        rows.append((f"`{mode}`", *(told if any(found) else (measured.missing(mode), NONE, NONE, NONE))))
    return ReportTable(
        "Where the time of an invocation goes: median / P95 in ms, all flights of a mode. Before: from the frame that "
        "releases the step to the request. Dispatch: from the answer to the frame, the written record included",
        columns("Mode", "#End-to-end", "#Before", "#Validation", "#Dispatch"),
        tuple(rows),
        ("end-to-end", "validation"),
    )


def fallback_section(measured: Measured) -> ReportSection:
    """X4: the microbenchmark of triggered conditions."""
    found: defaultdict[tuple[str, str], list[FallbackTiming]] = defaultdict(list)
    for each in measured.results:
        if isinstance(each, FallbackTiming):
            found[each.mode, each.case].append(each)
    modes = ordered_modes(mode for mode, _ in found)
    cases = sorted({case for _, case in found}, key=case_order)
    ordered = [(mode, case) for mode in modes for case in cases if (mode, case) in found]
    there = ("software", *ISOLATED)  # modes that enforce
    middle, high = FIGURES["x4/median"], FIGURES["x4/p95"]
    table = ReportTable(
        "Admission, selection of the fallback and its record, in ms, by condition; and the medians with the record "
        "written to its file, and on the disk",
        columns(
            "Condition, mode", "#Median", "#P95", "#P99", "#Greatest", "#Written, median", "#Synced, median", "#Runs"
        ),
        (
            ("paper [P], each condition", middle.text, f"below {high.text}", NONE, NONE, NONE, NONE, "30"),
            *(_condition(mode, case, found[mode, case]) for mode, case in ordered),
            *((f"`{mode}`", measured.missing(mode), *[NONE] * 5, "0") for mode in there if mode not in modes),
        ),
        ("conditions", "warm-up", "percentile"),
    )
    published = ChartBar("every condition", middle.high, f"{middle.text} ms", "published", middle.low, high.high)
    groups = [
        ChartGroup("paper", (published,)),
        *(ChartGroup(mode, tuple(_condition_bar(case, found[mode, case]) for of, case in ordered if of == mode))
          for mode in modes),
    ]  # fmt: skip
    title = "Fallback latency in ms, by condition"
    chart = bar_chart(title, "The figures are those of the table above.", groups, logarithmic=True)
    caption = f"{title}; logarithmic axis. Hatched: published. Bars are medians, whiskers reach to the P95."
    lead = (
        "No vehicle and no network: a condition strikes, and the decision, the fallback and its record are timed. The "
        "last table has the whole way from frame to frame, in flight.",
    )
    charts = [ReportChart(chart, caption)] if found else []
    return ReportSection("x4", "X4: fallback", lead, (table, *charts, _reactions(measured)))


def _reactions(measured: Measured) -> ReportTable:
    """From telemetry frame to command frame, by condition; of a condition that no frame reveals, why not."""
    took: defaultdict[tuple[str, str], list[int]] = defaultdict(list)
    for each in measured.results:
        if isinstance(each, FallbackReaction):
            took[each.case, each.mode].append(each.took_ns)
    modes, middle, high = ("software", *ISOLATED), FIGURES["x4/median"], FIGURES["x4/p95"]
    rows: list[ReportRow] = [
        ("paper [P], each condition, without frames", NONE, middle.text, f"below {high.text}", NONE, NONE, "30")
    ]
    for case in (each.name for each in CASES if each.outcome != "allow" and not each.extra):
        revealed, why_not = revealed_by(case)
        if not revealed:
            rows.append((case, why_not, *[NONE] * 4, NONE))
            continue
        for mode in modes:
            found = took[case, mode]
            told = _told(distribution(found)) if found else (measured.missing(mode), NONE, NONE, NONE)
            rows.append((f"{case}, `{mode}`", revealed, *told, str(len(found))))
    return ReportTable(
        "Telemetry frame in to command frame out, in ms: the fallback of a flight",
        columns("Condition, mode", "Revealed by", "#Median", "#P95", "#P99", "#Greatest", "#Runs"),
        tuple(rows),
        ("reaction", "conditions", "percentile"),
    )


def _condition(mode: str, case: str, runs: Sequence[FallbackTiming]) -> tuple[str, ...]:
    stored = (distribution(each.written_ns for each in runs), distribution(each.synced_ns for each in runs))
    local = _told(distribution(each.local_ns for each in runs))
    return f"{case}, `{mode}`", *local, *(ms(each and each.median) for each in stored), str(len(runs))


def _condition_bar(case: str, runs: Sequence[FallbackTiming]) -> ChartBar:
    took = [each.local_ns for each in runs]
    middle = median(took)
    return ChartBar(case, middle / 1e6, f"{ms(middle)} ms", "ours", middle / 1e6, p95(took) / 1e6)


def _told(found: Distribution | None) -> tuple[str, str, str, str]:
    """Median, P95, P99 and maximum in ms."""
    if found is None:
        return NONE, NONE, NONE, NONE
    return ms(found.median), ms(found.p95), ms(found.p99), ms(found.largest)


def isolation_section(measured: Measured) -> ReportSection:
    """X5: what an isolated mode adds to `software`, and to `process`."""
    lead = (
        "Flights of an isolated mode less those of another mode, paired by mission, deadline and seed. The boundary in "
        "`software` is in Python. In `process`, `trustzone-m` and `optee` it is the same program in C, which takes "
        "less time to decide: less `software` they show what a change of the mode costs, which may be less than "
        "nothing, and less `process` what the secure world costs.",
    )
    title = "What an isolated mode adds to `software`, in ms, by mission"
    groups = [ChartGroup(mission, (*_derived_bars(mission), *_added_bars(measured, mission))) for mission in MISSIONS]
    chart = bar_chart(
        title.replace("`", ""), "The figures are in the table of missions above.", groups, logarithmic=True
    )
    caption = (
        f"{title}; logarithmic axis, on which what is less than nothing has no bar. Hatched: derived from published "
        f"figures. {_WHISKERS}"
    )
    parts = (
        _added(measured, ISOLATED, "software"), _added(measured, ISOLATED[1:], "process"), _added_by_mission(measured),
        ReportChart(chart, caption),
    )  # fmt: skip
    return ReportSection("x5", "X5: the cost of isolation", lead, parts)


def _added(measured: Measured, modes: Sequence[str], base: str) -> ReportTable:
    """What modes add to another: over all points."""
    rows: list[ReportRow] = []
    stated = {
        "median validation": f"{FIGURES['x5/validation-median'].text} ({FIGURES['x5/validation-range'].text})",
        "median end-to-end": FIGURES["x5/end-to-end-median"].text,
        "P95 end-to-end": FIGURES["x5/end-to-end-p95"].text,
    }
    for mode in modes:
        for title, of, by in PAIRED:
            found = measured.flights.added_average(mode, base, None, of, by)
            few = "" if found is None or found.cells == len(POINTS) else f" ({found.cells} of {len(POINTS)} points)"
            lacking = measured.missing(base if mode not in measured.absent else mode)
            ours = (lacking, NONE) if found is None else (ms(found.mean), span(found) + few)
            rows.append((f"{title}, `{mode}`", stated[title] if mode == "optee" else NONE, *ours))
    return ReportTable(
        f"What an isolated mode adds to `{base}`, in ms: the mean over the points, and the least and greatest of them",
        columns("Quantity, mode", "#Paper [P]", "#Ours", "#Least to greatest"),
        tuple(rows),
        ("pairs", "languages", "modes", "percentile"),
    )


def _added_by_mission(measured: Measured) -> ReportTable:
    """What modes add to `software`: the figures of the chart."""
    rows: list[ReportRow] = []
    for mission in MISSIONS:
        derived = (f"+{FIGURES[f'x5/{key}/{mission}'].text}" for key in _DERIVED.values())
        rows.append((f"{mission}, paper, `optee` [D]", NONE, *derived))
        for mode in ISOLATED:
            found = [measured.flights.added_average(mode, "software", mission, of, by) for _, of, by in PAIRED]
            told = [NONE if each is None else f"{ms(each.mean)} ({span(each)})" for each in found]
            rows.append((f"{mission}, `{mode}`", *(told if any(found) else (measured.missing(mode), NONE, NONE))))
    return ReportTable(
        "What an isolated mode adds to `software`, in ms, by mission: the mean of the deadlines (the least to the "
        "greatest of them)",
        columns("Mission, mode", *(f"#Added {title}" for title, _, _ in PAIRED)),
        tuple(rows),
        ("pairs", "languages", "cell-average"),
    )


#: the quantities of X5 of which the paper's other figures give those of a mission
_DERIVED: Final = {"median end-to-end": "median", "P95 end-to-end": "p95"}


def _derived_bars(mission: str) -> Iterator[ChartBar]:
    for title, key in _DERIVED.items():
        figure = FIGURES[f"x5/{key}/{mission}"]
        yield ChartBar(f"paper, optee, {title} [D]", figure.high, f"+{figure.text} ms", "published")


def _added_bars(measured: Measured, mission: str) -> Iterator[ChartBar]:
    for mode in ISOLATED:
        for title, of, by in PAIRED:
            found = measured.flights.added_average(mode, "software", mission, of, by)
            bar = _bar(measured, f"{mode}, {title}", mode, found)
            yield bar if found is None or found.mean > 0 else bar._replace(value=None, low=None, high=None)


def cell_section(measured: Measured) -> ReportSection:
    """Every cell of X1: its end-to-end and validation latencies."""
    rows: list[tuple[str, ...]] = []
    for mode in MODES:
        for point in POINTS:
            flights = measured.flights.cell(mode, point)
            if flights:
                spreads = (measured.flights.spread(mode, point, of) for of in (end_to_end, validation))
                name = f"{point.mission}, {point.deadline_us / 1e6:g} s, `{mode}`"
                rows.append((name, *chain.from_iterable(map(_told, spreads)), str(len(flights))))
    statistics = ("#median", "#P95", "#P99", "#greatest")
    names = [each.replace("#", f"#{kind}, ") for kind in ("End-to-end", "Validation") for each in statistics]
    table = ReportTable(
        "Every cell with flights: end-to-end and validation latency in ms, over all invocations",
        columns("Cell", *names, "#Flights"),
        tuple(rows),
        ("end-to-end", "validation", "percentile"),
    )
    lead = ("The paper publishes no value of a single cell.",)
    return ReportSection("cells", "Every cell of X1", lead, (table,))
