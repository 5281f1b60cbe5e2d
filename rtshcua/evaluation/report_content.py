"""The report of the evaluation as data: the claims, and each table and figure of the paper with ours beside it.

`report_page` and `report_text` render it.
"""

from collections.abc import Iterable, Sequence

from rtshcua.campaign.campaign_report import CampaignSummary
from rtshcua.evaluation.check_sections import campaign_section, decision_section, evidence_section, footprint_section
from rtshcua.evaluation.comparison import COLUMNS, COMPARISON, OURS, Aim, ComparedProperty
from rtshcua.evaluation.computer import Computer
from rtshcua.evaluation.design import MODES, POINTS, RUNS
from rtshcua.evaluation.headline_claims import Claims, ClaimVerdict, Target, judge
from rtshcua.evaluation.latency_sections import (
    cell_section,
    fallback_section,
    isolation_section,
    normal_section,
    scaling_section,
)
from rtshcua.evaluation.published import DEFINITIONS, PLATFORM
from rtshcua.evaluation.report_parts import (
    NONE,
    EvaluationReport,
    Measured,
    ReportCell,
    ReportLinks,
    ReportRow,
    ReportSection,
    ReportTable,
    columns,
    digits,
)
from rtshcua.evaluation.results import Result

#: the style of a verdict
_KINDS = {ClaimVerdict.HELD: "held", ClaimVerdict.MISSED: "missed"}


def evaluation_report(
    results: Iterable[Result],
    computer: Computer,
    made: str,
    settings: Sequence[tuple[str, str]] = (),
    campaigns: Sequence[CampaignSummary] = (),
) -> EvaluationReport:
    """Return the report about raw results. `made` says when it was made, `settings` how the results were measured."""
    measured = Measured.of(results)
    claims = judge(measured.results)
    sections = (
        _claim_section(claims),
        _computer_section(computer, settings, measured),
        normal_section(measured),
        scaling_section(measured),
        decision_section(measured),
        fallback_section(measured),
        isolation_section(measured),
        evidence_section(measured),
        footprint_section(measured),
        campaign_section(campaigns),
        _comparison_section(),
        cell_section(measured),
        _definition_section(),
    )
    return EvaluationReport(
        "The published evaluation, measured again", made, computer, verdict(claims), claims, sections
    )


def verdict(claims: Claims) -> str:
    """Say in one sentence what became of the headline claims."""
    counts = {each: sum(claim.verdict is each for claim in claims.claims) for each in ClaimVerdict}
    told = ", ".join(f"{number} {each}" for each, number in counts.items() if number)
    if claims.failed:
        return f"Headline claims fail: {', '.join(f'`{each.slug}`' for each in claims.failed)}. All: {told}."
    return f"No headline claim fails: {told}."


def _claim_section(claims: Claims) -> ReportSection:
    rows: list[ReportRow] = [
        (each.text, _cell(each.verdict), each.published, each.measured or NONE, f"{each.runs:,} of {each.planned:,}")
        for each in claims.claims
    ]
    headline = ReportTable(
        "Headline claims. A claim holds only if all its runs are there; one that fails makes the exit code 1",
        columns("Claim", "Verdict", "Paper [P], unless marked", "Ours", "#Runs"),
        tuple(rows),
        ("flat", "microseconds", "warm-up", "agreement", "modes"),
    )
    targets: list[ReportRow] = [
        (
            *(each.text, _cell(each.verdict, _distance(each))),
            *(f"{each.stated} {each.unit}", f"{each.limit:.4g} {each.unit}"),
            NONE if each.measured is None else f"{digits(each.measured)} {each.unit}",
            f"{each.runs:,} of {each.planned:,}",
        )
        for each in claims.targets
    ]
    tenfold = ReportTable(
        "Our targets: a tenth of the published figure, of a range of its lower end. A missed target does not change "
        "the exit code; X2 shows where the time goes",
        columns("Target", "Verdict", "#Paper [P]", "#At most", "#Ours", "#Runs"),
        tuple(targets),
        ("tenfold", "end-to-end", "durability", "verification", "warm-up", "languages"),
    )
    return ReportSection("claims", "Claims and targets", (), (headline, tenfold))


def _cell(found: ClaimVerdict, more: str = "") -> ReportCell:
    return ReportCell(f"{found}{more}", _KINDS.get(found, "open"))


def _distance(target: Target) -> str:
    """By how much a target is met or missed."""
    if not target.measured or target.measured < 0 or target.verdict not in _KINDS:
        return ""
    if target.verdict is ClaimVerdict.MISSED:
        return f" by a factor of {digits(target.measured / target.limit)}"
    return f": {digits(target.published / target.measured)} times below the paper"


def _computer_section(computer: Computer, settings: Sequence[tuple[str, str]], measured: Measured) -> ReportSection:
    """The computers, and the modes that are there."""
    memory = NONE if computer.memory is None else f"{computer.memory / 2**30:.1f} GiB"
    versions = ", ".join(f"{name} {number}" for name, number in sorted(computer.versions.items()))
    ours = {
        "processor": f"{computer.processor}, {computer.cores} usable cores",
        "memory": memory,
        "system": computer.system,
        "tools": f"{computer.python}; {versions}",
        "agent": "none: the missions that ship",
        "trusted part": "QEMU: the columns of `trustzone-m` and `optee` are of emulated hardware",
        "vehicle": "the simulated vehicle of this project, in virtual time, behind the real driver",
    }
    rows: list[ReportRow] = [(part, value, ours.get(part, NONE)) for part, value in PLATFORM]
    rows.append(("version", NONE, f"rtshcua {computer.program}, commit `{computer.commit or 'unknown'}`"))
    rows.append(("load", NONE, ", ".join(f"{each:g}" for each in computer.load) or NONE))
    rows += [(name, NONE, value) for name, value in settings]
    machine = ReportTable(
        "The computers, and how the results were measured", columns("", "Paper [P]", "Ours"), tuple(rows)
    )
    planned = len(POINTS) * RUNS
    there: list[ReportRow] = []
    for mode in MODES:
        flights = len(measured.flights.flights(mode))
        there.append(
            (f"`{mode}`", f"{flights:,} of {planned:,}", _available(measured, mode), measured.absent.get(mode, ""))
        )
    modes = ReportTable(
        "Enforcement modes: the flights of X1 that are there, and what is not available on this computer",
        columns("Mode", "#Flights", "Here", "Why not"),
        tuple(there),
        ("modes", "none"),
    )
    return ReportSection("computer", "Computers and modes", (), (machine, modes))


def _comparison_section() -> ReportSection:
    """The comparison table of the paper, with today's peers, and what shows our entries."""
    works: list[ReportRow] = [
        (
            f"{each.work} {each.judge}",
            *(ReportCell(entry.aim, "open" if entry.aim is Aim.NO else "") for entry in each.entries),
        )
        for each in COMPARISON
    ]
    compared = ReportTable(
        "Whether a property is a first-class aim of a design, in part, or not at all. [P]: the paper's judgement; "
        "[ours]: our judgement",
        columns("Work", *(each.title for each in COLUMNS)),
        tuple(works),
        ("peers",),
    )
    decided = ReportTable(
        "What decided our rows, by sources read in November 2026",
        columns("Work", "What decided", "Sources"),
        tuple(
            (each.work, each.note, ReportLinks(each.sources) if each.sources else NONE)
            for each in COMPARISON
            if each.note
        ),
    )
    shown = ReportTable(
        "What shows the entries of this system: tests and pages of this project. The tests were not run for this "
        "report",
        columns("Property", "What counts as an aim", "Shown by", "Limits"),
        tuple(_shown(each) for each in COLUMNS),
    )
    return ReportSection("comparison", "Comparison with other work", (), (compared, decided, shown))


def _shown(property_: ComparedProperty) -> ReportRow:
    entry = OURS.entry(property_.key)
    shown_by = ", ".join(f"`{path}`" for path in entry.shown_by)
    return property_.title, property_.meaning, shown_by, entry.limits or NONE


def _definition_section() -> ReportSection:
    lead = ("`docs/paper-map.md` names the code of each symbol.",)
    table = ReportTable("What the paper defines", columns("Symbol or term", "Meaning [P]"), DEFINITIONS)
    return ReportSection("definitions", "Definitions of the paper", lead, (table,))


def _available(measured: Measured, mode: str) -> ReportCell:
    absent = mode in measured.absent
    return ReportCell("not available here" if absent else "available", "open" if absent else "held")
