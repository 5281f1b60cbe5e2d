"""The service `bench paper`: run the experiments of the published evaluation, keep their raw data, and report."""

import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, closing
from pathlib import Path
from typing import Final, NamedTuple, Protocol

import msgspec

from rtshcua import __version__
from rtshcua.adapters.store.reading import read_if_there
from rtshcua.adapters.store.writing import replace
from rtshcua.app.exit_codes import words_of
from rtshcua.app.wording import utc
from rtshcua.campaign.campaign_report import MARGINS, CampaignSummary
from rtshcua.campaign.workers import FlightWorkers, Look, WorkerProcesses, cores
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evaluation import report_page, report_text, sources
from rtshcua.evaluation.computer import this_computer
from rtshcua.evaluation.design import MODES, RUNS, EvaluationPlan, WorkUnit
from rtshcua.evaluation.experiments import EXPERIMENTS, SOURCES, EvaluationWork, UnitResults, batches
from rtshcua.evaluation.modes import unavailable
from rtshcua.evaluation.raw_data import (
    FORMAT,
    MALFORMED,
    KeptResult,
    RawExperiment,
    RawFolder,
    RawHeader,
    design_digest,
)
from rtshcua.evaluation.report_content import evaluation_report
from rtshcua.evaluation.report_parts import EvaluationReport
from rtshcua.evaluation.results import FailedAttempt, Result, UnavailableMode

#: where raw data and report go by default, and those of a sample
OUTPUT: Final = Path("runs") / "evaluation"
QUICK_OUTPUT: Final = Path("runs") / "evaluation-quick"
#: the names of the report as a page and as a text
PAGE, TEXT = "report.html", "report.md"
_LARGEST: Final = 1 << 24
#: characters of why an attempt failed that are kept
_LONGEST_WHY: Final = 500


class EvaluationRequest(NamedTuple):
    """Which experiments (none: all) run in which modes (none: all), how often (None: as published, or once if `quick`),
    by how many processes (None: one for each core), in which folder; and the folders of campaigns to report.
    """

    only: Sequence[str]
    modes: Sequence[str]
    runs: int | None
    jobs: int | None
    quick: bool
    output: Path
    campaigns: Sequence[Path] = ()


class Evaluation(NamedTuple):
    """An evaluation that can be measured: all units that are asked for, and those of them that are left."""

    folder: RawFolder
    headers: Sequence[RawHeader]
    plan: EvaluationPlan
    jobs: int
    units: Sequence[WorkUnit]
    left: Sequence[WorkUnit]
    campaigns: Sequence[CampaignSummary]


class EvaluationOutcome(NamedTuple):
    """How many units of the request are done, and why others are not."""

    done: int
    asked: int
    failed: Sequence[UnitResults]


class WrittenReport(NamedTuple):
    """The report about all that is in a folder, its files, and what in the raw data is not counted, by experiment."""

    report: EvaluationReport
    page: Path
    text: Path
    not_counted: Sequence[tuple[str, str]] = ()


class EvaluationProgress(Protocol):
    """Shows how far an evaluation is. Each method may raise to stop it."""

    def begun(self, made: Evaluation) -> None:
        """The measurements begin."""

    def measured(self, found: UnitResults, left_s: float | None) -> None:
        """The results of a unit are kept; `left_s` estimates the rest of the time."""

    def clear(self) -> None:
        """The measurements are over."""


class EvaluationStop(AbstractContextManager[object], Protocol):
    """Within it, `look` raises when the evaluation is to stop."""

    def look(self) -> None:
        """Raise if it is to stop."""


def prepare(request: EvaluationRequest) -> Evaluation | Refusal:
    """Find what is to be measured, and what is there already. Raises OSError."""
    misused = _misused(request)
    if misused is not None:
        return misused
    campaigns = _campaigns(request.campaigns)
    if isinstance(campaigns, Refusal):
        return campaigns
    folder = RawFolder(request.output)
    plan = _plan(request)
    headers = _headers(request.only or [*SOURCES], quick=request.quick)
    units, done = [unit for each in headers for unit in EXPERIMENTS[each.experiment].units(plan)], set[WorkUnit]()
    for header in headers:
        found = folder.differs(header) or folder.read(header.experiment)
        if isinstance(found, Refusal):
            return found
        done |= set() if found is None else {unit for unit, kept in found.units.items() if not _available_now(kept)}
    left = [unit for unit in units if unit not in done]
    return Evaluation(folder, headers, plan, request.jobs or cores(), units, left, campaigns)


#: makes the processes that measure: so many, and what is called while they are waited for
Pool = Callable[[int, Look], FlightWorkers]


def measure(
    made: Evaluation, progress: EvaluationProgress, stop: EvaluationStop, pool: Pool = WorkerProcesses
) -> EvaluationOutcome | Refusal:
    """Run what is left, and keep each result at once. `progress` and `stop` may raise; results stay."""
    folder = made.folder
    try:
        with folder.held() as scratch:
            for header in made.headers:
                refused = folder.begin(header)
                if refused is not None:
                    return refused
            failed = _run(made, scratch, progress, stop, pool)
    except BlockingIOError:
        text = f"another process writes to `{folder.path}`"
        return Refusal("in-use", text, "wait until it ends, or name another folder with `-o`", ExitCode.USAGE)
    except OSError as error:
        text = f"cannot write to `{folder.path}`: {words_of(error)}"
        kept = any(folder.path.glob("X*.jsonl"))
        help = (
            "the results so far are kept: repeat the command to continue" if kept else "name another folder with `-o`"
        )
        return Refusal("io", text, help, ExitCode.FULL)
    return EvaluationOutcome(len(made.units) - len(failed), len(made.units), failed)


def _run(
    made: Evaluation, scratch: str, progress: EvaluationProgress, stop: EvaluationStop, pool: Pool
) -> Sequence[UnitResults]:
    """Run what is left in processes. Raises OSError."""
    failed, clock = list[UnitResults](), _TimeLeft(made.left, made.jobs)
    try:
        with closing(pool(made.jobs, stop.look)) as workers, stop:
            progress.begun(made)
            for batch in workers.fly(EvaluationWork(scratch), batches(made.left)):
                for found in batch.units:
                    results, load = found.results, round(found.load, 2)
                    if found.failed:
                        failed.append(found)
                        results = (FailedAttempt(why=found.failed[:_LONGEST_WHY]),)
                    made.folder.keep(found.unit, results, at=found.at, load=load, jobs=made.jobs)
                    progress.measured(found, clock.after(found))
    finally:
        progress.clear()
    return failed


def report(made: Evaluation) -> WrittenReport | Refusal:
    """Write the report about what is in the folder, as HTML and Markdown."""
    folder, found, results = made.folder, list[RawExperiment](), list[Result]()
    for name in dict.fromkeys(SOURCES.values()):
        raw = folder.read(name)
        if isinstance(raw, Refusal):
            return raw
        if raw is not None:
            found.append(raw)
            results += raw.results
    computer = found[0].header.computer if found else this_computer()
    at = f"made at {utc(time.time_ns() // 1_000)}"
    told = evaluation_report(results, computer, at, _settings(found), made.campaigns)
    left_out = [(each.header.experiment, text) for each in found for text in _left_out(each)]
    written = WrittenReport(told, folder.path / PAGE, folder.path / TEXT, left_out)
    try:
        replace(written.page, report_page.render(told).encode())
        replace(written.text, report_text.render(told).encode())
    except OSError as error:
        return Refusal("io", f"cannot write to `{folder.path}`: {words_of(error)}", "", ExitCode.FULL)
    return written


def _available_now(kept: Sequence[KeptResult]) -> bool:
    """Whether all that a unit gave is that its mode was not available, and it is now."""
    missing = [each.result.mode for each in kept if isinstance(each.result, UnavailableMode)]
    return len(missing) == len(kept) > 0 and all(unavailable(mode) is None for mode in missing)


def _campaigns(paths: Sequence[Path]) -> Sequence[CampaignSummary] | Refusal:
    """The summaries of the campaigns in folders. Raises OSError."""
    found = list[CampaignSummary]()
    for path in paths:
        summary = _campaign(path)
        if isinstance(summary, Refusal):
            return summary
        found.append(summary)
    return found


def _campaign(path: Path) -> CampaignSummary | Refusal:
    """The summary of the campaign in a folder. Raises OSError."""
    octets = read_if_there(path / "report.json", _LARGEST)
    help = "give the folder of a campaign that has a report: `rtshcua campaign`"
    if octets is None:
        return Refusal("input", f"`{path}` has no `report.json` of a campaign", help, ExitCode.INPUT)
    try:
        summary = msgspec.json.decode(octets, type=CampaignSummary)
    except MALFORMED:
        summary = None
    if summary is None or not {each.name for each in summary.margins} <= MARGINS.keys():
        return Refusal("input", f"`{path / 'report.json'}` is not the report of a campaign", help, ExitCode.INPUT)
    return summary


def _settings(found: Sequence[RawExperiment]) -> Sequence[tuple[str, str]]:
    """How the results of each experiment were measured: by how many processes, at which load, and what is not in them.
    Another computer than that of the first experiment is named.
    """
    told, first = [], found[0].header.computer if found else None
    for each in found:
        name, computer = each.header.experiment, each.header.computer
        if first is not None and computer.described != first.described:
            told.append((f"{name}, computer", computer.described))
        told += [(f"{name}, not counted", text) for text in _left_out(each)]
        kept = [part for parts in each.units.values() for part in parts]
        if not kept:
            continue
        loads, jobs = sorted(part.load for part in kept), sorted({part.jobs for part in kept})
        began, ended = (utc(1_000_000 * second) for second in (each.header.began, max(part.at for part in kept)))
        told.append(
            (
                f"{name}, measured",
                f"{began} to {ended}, by {' or '.join(map(str, jobs))} processes at a time; load average "
                f"{loads[0]:.1f} to {loads[-1]:.1f}, median {loads[len(loads) // 2]:.1f}"
                f"{'; a sample (`--quick`)' if each.header.quick else ''}",
            )
        )
    return told


def _left_out(found: RawExperiment) -> Iterator[str]:
    """What a file holds besides results."""
    if found.skipped:
        yield f"{found.skipped:,} lines that are cut off, malformed, not of the design or of incomplete units"
    if found.failed:
        unit, first = found.failed[0]
        units = len({unit for unit, _ in found.failed})
        open_ = len({unit for unit, _ in found.failed} - found.units.keys())
        yield (
            f"{len(found.failed):,} attempts at {units:,} units of work failed, {open_:,} of which have no results "
            f"yet; the first: {' '.join(map(str, unit.key))}: {first.why}"
        )


class _TimeLeft:
    """Estimates the rest of the time by the mean time of units of the same kind: experiment, mission and mode."""

    def __init__(self, units: Sequence[WorkUnit], jobs: int) -> None:
        self._left = Counter(map(_kind, units))
        self._times = defaultdict[object, list[float]](list)
        self._jobs = jobs

    def after(self, found: UnitResults) -> float:
        """The rest of the time after a unit, in s."""
        self._left[_kind(found.unit)] -= 1
        self._times[_kind(found.unit)].append(found.took_s)
        times = [each for kind in self._times.values() for each in kind]
        usual = sum(times) / len(times)
        means = {kind: sum(each) / len(each) for kind, each in self._times.items()}
        return sum(count * means.get(kind, usual) for kind, count in self._left.items()) / self._jobs


def _kind(unit: WorkUnit) -> object:
    return unit.experiment, *(part for part in unit.key if isinstance(part, str))


def _headers(asked: Sequence[str], *, quick: bool) -> Sequence[RawHeader]:
    """The headers of new files of what is asked for. Raises OSError."""
    names = {SOURCES[name] for name in asked}
    computer, began = this_computer(), int(time.time())
    package = Path(__file__).resolve().parents[1]
    design = design_digest([package, sources.folder()])
    return [
        RawHeader(
            format=FORMAT, experiment=name, program=__version__, commit=computer.commit, design=design, quick=quick,
            began=began, computer=computer,
        )
        for name in EXPERIMENTS
        if name in names
    ]  # fmt: skip


def _plan(request: EvaluationRequest) -> EvaluationPlan:
    modes = tuple(mode for mode in MODES if mode in request.modes or not request.modes)
    return EvaluationPlan(request.runs or (1 if request.quick else RUNS), modes, request.quick)


def _misused(request: EvaluationRequest) -> Refusal | None:
    """Why the names of experiments or modes, the number of processes, or the folder are not accepted."""
    for kind, given, accepted in (("experiment", request.only, SOURCES), ("mode", request.modes, MODES)):
        unknown = next((name for name in given if name not in accepted), None)
        if unknown is not None:
            return Refusal("usage", f"no such {kind}: `{unknown}`", f"accepted: {', '.join(accepted)}")
    if request.jobs is not None and request.jobs > cores():
        text = f"`--jobs {request.jobs}` is more than the {cores()} cores, and processes on one core disturb each other"
        return Refusal("usage", text, f"accepted: at most {cores()}")
    if request.output.exists() and not request.output.is_dir():
        return Refusal("usage", f"`{request.output}` is not a folder", "`-o` expects the folder of an evaluation")
    return RawFolder(request.output).foreign_report((PAGE, TEXT))
