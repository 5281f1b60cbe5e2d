"""The report's sections about decisions, evidence, size and random faults: X3, X6, X7 and campaigns."""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from statistics import median
from typing import Final

from rtshcua.campaign.campaign_report import CampaignSummary, FindingSummary, margin_told
from rtshcua.evaluation.design import MODES, UNENFORCED
from rtshcua.evaluation.headline_claims import passes
from rtshcua.evaluation.measures import distribution
from rtshcua.evaluation.published import CASES, FIGURES, FOOTPRINT, FOOTPRINT_TOTAL, PublishedComponent
from rtshcua.evaluation.report_parts import (
    NONE,
    UNMEASURED,
    Measured,
    ReportCell,
    ReportChart,
    ReportRow,
    ReportSection,
    ReportTable,
    case_order,
    columns,
    digits,
    ordered_modes,
    us,
)
from rtshcua.evaluation.results import (
    AppendTiming,
    CaseFlight,
    ComponentSize,
    EnforceCheck,
    VerificationTiming,
)
from rtshcua.ground.drawing.bar_chart import StackedPart, StackedRow, stacked_chart

#: how many failing checks are listed
_LISTED: Final = 20
_OUTCOMES: Final = ("allow", "fallback", "defer", "deny")
#: our rows whose components have another name in the paper; a home is one of several places of the boundary
HOME: Final = "trusted enforcement: "
OURS: Final = {"trusted enforcement TA": f"{HOME}optee"}
#: the style of each ending of a flight; all others are drawn as `deny`
_ENDINGS: Final = {"completed": "allow", "aborted": "fallback", "stood-down": "defer"}


def decision_section(measured: Measured) -> ReportSection:
    """X3: the degraded and security suite."""
    checks = [each for each in measured.results if isinstance(each, EnforceCheck) and each.mode != UNENFORCED]
    flown = [each for each in measured.results if isinstance(each, CaseFlight)]
    lead = (
        "Twelve cases at 21 points, 30 times, as request bytes to `enforce` and answer bytes back: 7,560 checks in "
        "each mode. Recoverable trouble falls back, missing state defers, and what is not authentic or not permitted "
        "is denied. The paper names the cases marked [P]; the others are ours.",
    )
    parts: list[ReportTable | ReportChart] = [_by_case(measured, checks)]
    if checks:
        title = "Decisions of X3 by case, all modes together"
        chart = stacked_chart(title, "The counts are those of the table above.", _stacked(checks))
        parts.append(ReportChart(chart, f"{title}. Hatched: another decision than expected, or than the reference."))
    wrong = [each for each in checks if not passes(each)]
    if wrong:
        parts.append(_disagreements(wrong))
    if any(each.mode == "none" for each in checks):
        parts.append(_permitted(checks))
    parts.append(_flown(flown))
    lost = [each for each in flown if not each.holds]
    if lost:
        parts.append(_undone(lost))
    return ReportSection("x3", "X3: degraded and security cases", lead, tuple(parts))


def _by_case(measured: Measured, checks: Sequence[EnforceCheck]) -> ReportTable:
    """How many checks pass, by case and mode."""
    modes = ordered_modes({*(each.mode for each in checks), *MODES} - {UNENFORCED})
    passed = Counter((each.case, each.mode) for each in checks if passes(each))
    seen = Counter((each.case, each.mode) for each in checks)

    def cell(among: Sequence[str], cases: Sequence[str]) -> str | ReportCell:
        right, of = (sum(counted[case, mode] for case in cases for mode in among) for counted in (passed, seen))
        if not of:
            return measured.missing(among[0]) if len(among) == 1 else UNMEASURED
        return ReportCell(f"{right:,} of {of:,}", "held" if right == of else "missed")

    def cells(cases: Sequence[str]) -> Iterator[str | ReportCell]:
        yield from (cell([mode], cases) for mode in modes)
        yield cell(modes, cases)

    rows: list[ReportRow] = []
    for case in CASES:
        mark = " (apart)" if case.extra else " [P]" if case.named else ""
        name = f"{case.number}. {case.name}{mark}: {case.perturbation}"
        rows.append((name, f"{case.outcome}, `{case.reason}`", *cells([case.name])))
    twelve = [case.name for case in CASES if not case.extra]
    rows.append(("the twelve; paper [P]: 7,560 of 7,560", "", *cells(twelve)))
    return ReportTable(
        "Checks that decide as expected and as the reference, by case and mode",
        columns("Case, and what strikes", "Expected", *(f"#{mode}" for mode in modes), "#All modes"),
        tuple(rows),
        ("cases", "agreement", "repetitions"),
    )


def _stacked(checks: Sequence[EnforceCheck]) -> list[StackedRow]:
    """A bar for each case, with a part for each outcome."""
    rows = []
    for case in CASES:
        said = Counter(
            each.outcome if passes(each) else f"wrong: {each.outcome}" for each in checks if each.case == case.name
        )
        parts = [
            StackedPart(outcome if outcome in _OUTCOMES else "wrong", number, f"{outcome} {number:,}")
            for outcome, number in sorted(said.items(), key=lambda each: -each[1])
        ]
        rows.append(StackedRow(f"{case.number}. {case.name}", tuple(parts)))
    return rows


def _disagreements(wrong: Sequence[EnforceCheck]) -> ReportTable:
    """The first checks that fail."""
    rows = tuple(
        (
            f"{each.case}, {each.mission}, {each.deadline_us / 1e6:g} s, `{each.mode}`, {each.repetition}",
            f"{each.outcome}, `{each.reason}`",
            "yes" if each.as_expected else "no",
            "yes" if each.agrees else "no",
            each.differs or NONE,
        )
        for each in wrong[:_LISTED]
    )
    return ReportTable(
        f"Checks that fail: {len(wrong):,}; the first {len(rows)}",
        columns("Case, mission, deadline, mode, repetition", "Decided", "As expected", "As the reference", "Answers"),
        rows,
    )


def _permitted(checks: Sequence[EnforceCheck]) -> ReportTable:
    """What is permitted though it was not allowed: everything in `none`, nothing elsewhere."""
    refused, permitted = Counter[str](), Counter[str]()
    for each in checks:
        if each.outcome != "allow":
            refused[each.mode] += 1
            permitted[each.mode] += each.permits > 0
    rows = tuple((f"`{mode}`", f"{refused[mode]:,}", f"{permitted[mode]:,}") for mode in ordered_modes(refused))
    return ReportTable(
        "Checks that are not allowed, and how many of them come with a permit",
        columns("Mode", "#Not allowed", "#With a permit"),
        rows,
        ("agreement", "none"),
    )


def _flown(flown: Sequence[CaseFlight]) -> ReportTable:
    """The cases through the whole runtime."""
    found: defaultdict[tuple[str, bool, str], list[CaseFlight]] = defaultdict(list)
    for each in flown:
        found[each.case, each.aloft, each.expected].append(each)
    rows: list[ReportRow] = []
    for (case, aloft, expected), flights in sorted(found.items(), key=lambda each: case_order(each[0][0])):
        good = sum(each.holds for each in flights)
        cell = ReportCell(f"{good:,} of {len(flights):,}", "held" if good == len(flights) else "missed")
        endings = Counter(each.ending for each in flights)
        ended = ", ".join(f"{number:,} {ending}" for ending, number in sorted(endings.items()))
        rows.append((case, "in the air" if aloft else "on the ground", expected, cell, ended))
    return ReportTable(
        "The cases through the whole runtime, in virtual time: what is dispatched",
        columns("Case", "Struck", "Expected", "#As expected", "Endings"),
        tuple(rows),
        ("whole-runtime",),
        () if flown else (f"No case was flown: {UNMEASURED}.",),
    )


def _undone(lost: Sequence[CaseFlight]) -> ReportTable:
    """The first flights in which a case does not hold."""
    rows = tuple(
        (
            f"{each.case}, {each.mission}, {each.deadline_us / 1e6:g} s, {each.flavour}, seed {each.seed}",
            each.expected,
            ", ".join(each.dispatched) or "nothing",
            each.ending,
            each.differs or NONE,
        )
        for each in lost[:_LISTED]
    )
    return ReportTable(
        f"Flights in which a case does not hold: {len(lost):,}; the first {len(rows)}",
        columns("Case, mission, deadline, autopilot, seed", "Expected", "Dispatched", "Ending", "What differs"),
        rows,
    )


def evidence_section(measured: Measured) -> ReportSection:
    """X6: append and audit."""
    lead = ("A log of 1,000 records as in the paper, and a long one. The paper's rows are comparable to ours in bold.",)
    parts = (_appends(measured), _verifications(measured))
    return ReportSection("x6", "X6: evidence", lead, parts)


def _appends(measured: Measured) -> ReportTable:
    """Append by durability and length of the log."""
    found: defaultdict[tuple[str, int], list[AppendTiming]] = defaultdict(list)
    for each in measured.results:
        if isinstance(each, AppendTiming):
            found[each.durability, len(each.appended_ns)].append(each)
    stated = (FIGURES[f"x6/{key}"].text for key in ("append-median", "append-p95", "append-p99"))
    rows: list[ReportRow] = [("paper [P]", FIGURES["x6/records"].text, *stated, NONE, FIGURES["x6/octets"].text, NONE)]
    for (durability, records), logs in sorted(found.items(), key=lambda each: each[0][1]):
        spread = distribution(took for log in logs for took in log.appended_ns)
        if spread is None:
            continue
        mean = sum(log.octets for log in logs) / (records * len(logs))
        times = [us(each) for each in (spread.median, spread.p95, spread.p99, spread.largest)]
        compared = durability == "written" and records == FIGURES["x6/records"].low
        name = ReportCell(durability, "compared") if compared else durability
        rows.append((name, f"{records:,}", *times, digits(mean), str(len(logs))))
    return ReportTable(
        "Append of a record, in us",
        columns("Append", "#Records", "#Median", "#P95", "#P99", "#Greatest", "#Mean record, bytes", "#Logs"),
        tuple(rows),
        ("durability", "warm-up", "percentile"),
        () if found else (f"No append was timed: {UNMEASURED}.",),
    )


def _verifications(measured: Measured) -> ReportTable:
    """Verification by depth and length of the log, and whether the bundle was opened before."""
    found: defaultdict[tuple[str, int, bool], list[float]] = defaultdict(list)
    for each in measured.results:
        if isinstance(each, VerificationTiming) and each.records:
            found[each.way, each.records, each.cold].append(each.took_ns / each.records)
    rows: list[ReportRow] = [
        ("paper [P]", FIGURES["x6/records"].text, FIGURES["x6/verification"].text, FIGURES["x6/throughput"].text, NONE)
    ]
    for (way, records, cold), took in sorted(found.items(), key=lambda each: each[0][1:]):
        middle = median(took)
        compared = way == "default" and records == FIGURES["x6/records"].low and not cold
        name = ReportCell(way, "compared") if compared else f"{way}, cold" if cold else way
        rows.append((name, f"{records:,}", us(middle), digits(1e9 / middle) if middle else NONE, str(len(took))))
    return ReportTable(
        "Verification of a log: time of a record in us, the median of the runs. Cold: the bundle was not opened before",
        columns("Verification", "#Records", "#Record", "#Records in a second", "#Runs"),
        tuple(rows),
        ("verification", "warm-up"),
        () if found else (f"No verification was timed: {UNMEASURED}.",),
    )


def footprint_section(measured: Measured) -> ReportSection:
    """X7: the footprint on board."""
    sizes = {each.component: each for each in measured.results if isinstance(each, ComponentSize)}
    ours = [*sizes.values()]
    lead = ("Without the agent, the model, the simulator, the libraries of MAVLink, OP-TEE itself and the autopilot.",)
    parts = (_sizes_table(ours), _files_table(ours))
    return ReportSection("x7", "X7: footprint on board", lead, parts)


def _sizes_table(ours: Sequence[ComponentSize]) -> ReportTable:
    """Each component, published and ours, and the sums of the rows."""
    found = {each.component: each for each in ours}
    rows: list[ReportRow] = []
    for stated in FOOTPRINT:
        measured = found.pop(OURS.get(stated.component, stated.component), None)
        also = "" if measured is None or measured.component == stated.component else f" (ours: {measured.component})"
        rows.append(_size_row(stated.component + also, stated, measured))
    rows += [_size_row(each.component, None, each) for each in found.values()]
    rows.append(_size_row(FOOTPRINT_TOTAL.component, FOOTPRINT_TOTAL, None))
    key = "x7/{}-summed"
    sums = (FIGURES[key.format(kind)].text for kind in ("lines", "artifact", "memory"))
    rows.append(("sum of the rows [D]", "", *(each for text in sums for each in (text, NONE)), ""))
    rows += _our_sums(ours)
    shared, further = FIGURES["x7/artifact-shared"].text, FIGURES["x7/artifact-unexplained"].text
    return ReportTable(
        "Code lines without blanks, comments and docstrings; artifact and peak memory in KB (ours: of 1,024 bytes)",
        columns(
            "Component", "Domain", "#Lines [P]", "#Lines", "#Artifact [P]", "#Artifact", "#Peak memory [P]",
            "#Peak memory", "State",
        ),
        tuple(rows),
        ("footprint",),
        (
            "The printed totals are not the sums of the printed rows. Artifacts may share files: with the 8.29 KB that "
            f"two rows have in common counted once, the sum is {shared} KB [D], and {further} KB more are shared [D].",
            *(() if ours else (f"X7 was {UNMEASURED}.",)),
        ),
    )  # fmt: skip


def _our_sums(ours: Sequence[ComponentSize]) -> Iterator[ReportRow]:
    """The sums of our rows for each home of the boundary, of which a vehicle has one."""
    without = [each for each in ours if not each.component.startswith(HOME)]
    for home in ours:
        if home.component.startswith(HOME):
            sums = [_sum([*without, home], of) for of in (_lines, _artifact, _memory)]
            told = (each for text in _sizes(*sums) for each in (NONE, text))
            state = "incomplete: a row has no size" if None in sums else ""
            yield f"sum of our rows, `{home.component.removeprefix(HOME)}` as the only home", "", *told, state


def _size_row(name: str, stated: PublishedComponent | None, ours: ComponentSize | None) -> ReportRow:
    """A component: each published size, and ours after it."""
    paper = (NONE,) * 3 if stated is None else (
        f"{stated.code_lines:,}", f"{stated.artifact_kb:.2f}", f"{stated.memory_kb:.2f}"
    )  # fmt: skip
    measured = (NONE,) * 3 if ours is None else _sizes(ours.code_lines, ours.artifact, ours.memory)
    domain = ours.domain if ours is not None else stated.domain if stated is not None else ""
    pairs = (each for pair in zip(paper, measured, strict=True) for each in pair)
    return name, domain, *pairs, ours.state if ours is not None else NONE


def _files_table(ours: Sequence[ComponentSize]) -> ReportTable:
    rows = tuple((each.component, ", ".join(f"`{path}`" for path in each.files)) for each in ours)
    return ReportTable("The files of our components", columns("Component", "Files"), rows)


def _lines(each: ComponentSize) -> int | None:
    return each.code_lines


def _artifact(each: ComponentSize) -> int | None:
    return each.artifact


def _memory(each: ComponentSize) -> int | None:
    return each.memory


def _sum(components: Sequence[ComponentSize], of: Callable[[ComponentSize], int | None]) -> int | None:
    """The sum of a size; None where a component has none, as a home that was not built."""
    sizes = [size for each in components if (size := of(each)) is not None]
    return sum(sizes) if len(sizes) == len(components) else None


def _sizes(lines: int | None, artifact: int | None, memory: int | None) -> tuple[str, str, str]:
    """Code lines, and two sizes in KB."""
    size, peak = (NONE if each is None else f"{each / 1024:,.2f}" for each in (artifact, memory))
    return NONE if lines is None else f"{lines:,}", size, peak


def campaign_section(campaigns: Sequence[CampaignSummary]) -> ReportSection:
    """The flights with random faults."""
    lead = (
        "Flights in virtual time with random faults, each judged by the true state of the simulated vehicle. The judge "
        "uses no code of the runtime, and decides each log again. The paper has no such experiment.",
    )
    if not campaigns:
        return ReportSection(
            "campaign", "Random faults", (*lead, f"No campaign was given (`--campaign DIR`): {UNMEASURED}."), ()
        )
    parts: list[ReportTable | ReportChart] = []
    for summary in campaigns:
        name = f"`{summary.mission}`, seed {summary.campaign}"
        parts += [_endings(summary, name), _findings(summary, name), _margins(summary, name)]
    rows = [
        StackedRow(
            f"{summary.mission}, {flavour}",
            tuple(StackedPart(_ENDINGS.get(ending, "deny"), n, f"{ending} {n:,}") for ending, n in counts.items()),
        )
        for summary in campaigns
        for flavour, counts in summary.endings.items()
    ]
    title = "How flights with random faults end, by autopilot"
    chart = stacked_chart(title, "The counts are those of the tables.", rows)
    return ReportSection("campaign", "Random faults", lead, (ReportChart(chart, f"{title}."), *parts))


def _endings(summary: CampaignSummary, name: str) -> ReportTable:
    endings = sorted({ending for counts in summary.endings.values() for ending in counts})
    rows = tuple(
        (flavour, *(f"{counts.get(ending, 0):,}" for ending in endings), f"{sum(counts.values()):,}")
        for flavour, counts in summary.endings.items()
    )
    return ReportTable(
        f"{name}: {summary.flights:,} flights, {summary.failed:,} failed, {summary.flown_us / 3.6e9:.1f} h in the air",
        columns("Autopilot", *(f"#{ending}" for ending in endings), "#Flights"),
        rows,
        ("campaign",),
    )


def _findings(summary: CampaignSummary, name: str) -> ReportTable:
    """Failures, and what could not have been prevented on board."""

    def row(each: FindingSummary, kind: str) -> ReportRow:
        flights = ", ".join(map(str, each.first[:3]))
        text = f"{each.text} ({each.why})" if each.why else each.text
        style = "missed" if kind == "failure" else "open"
        return ReportCell(kind, style), f"`{each.slug}`", text, f"{each.flights:,}", flights

    rows = (
        *(row(each, "failure") for each in summary.failures),
        *(row(each, "excused") for each in summary.exceptions),
    )
    return ReportTable(
        f"{name}: failures, and excused failures, which could not have been prevented on board",
        columns("Kind", "Failure", "What or why", "#Flights", "#First flights"),
        rows,
        notes=() if summary.failures else ("No flight failed.",),
    )


def _margins(summary: CampaignSummary, name: str) -> ReportTable:
    """The worst margins: the least distances and the longest times."""
    rows = []
    for each in summary.margins:
        worst = (each.least, each.least_in) if each.name.endswith("_mm") else (each.greatest, each.greatest_in)
        told = (margin_told(each.name, worst[0]), f"{worst[1]:,}", margin_told(each.name, each.middle))
        rows.append((each.title, *told, f"{each.flights:,}"))
    return ReportTable(
        f"{name}: margins",
        columns("Margin", "#Worst", "#In flight", "#Median", "#Flights"),
        tuple(rows),
    )
