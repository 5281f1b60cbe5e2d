"""`rtshcua bench`: run the published evaluation on this computer."""

import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from rtshcua.app import evaluation as service
from rtshcua.app.evaluation import OUTPUT, QUICK_OUTPUT, Evaluation, EvaluationOutcome, EvaluationRequest, WrittenReport
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evaluation.experiments import UnitResults
from rtshcua.evaluation.headline_claims import ClaimVerdict
from rtshcua.front.cli.faults import say
from rtshcua.front.cli.interrupts import Stopped, StopRequest
from rtshcua.front.cli.render.findings import Findings
from rtshcua.front.cli.render.progress import time_left
from rtshcua.front.cli.stdout import out

app = typer.Typer(add_completion=False)

_CLEAR: Final = "\r\033[K"
#: without a terminal, a line of progress at most this often, in s
_EVERY_S: Final = 60.0

Only = Annotated[
    str | None, typer.Option(metavar="X1,X3", help="only these experiments, separated by commas [default: all]")
]
Modes = Annotated[
    str | None, typer.Option(metavar="MODE,MODE", help="only these modes, separated by commas [default: all]")
]
Runs = Annotated[
    int | None, typer.Option(min=1, max=10_000, help="repetitions of each cell [default: 30; with --quick 1]")
]
Jobs = Annotated[
    int | None, typer.Option("--jobs", "-j", min=1, help="number of processes [default: one for each core]")
]
Quick = Annotated[bool, typer.Option("--quick", help="measure a sample, in two minutes on two cores")]
Campaigns = Annotated[
    list[Path] | None,
    typer.Option(metavar="DIR", help="report the flights of this campaign too (repeatable): docs/flying/campaigns.md"),
]
Output = Annotated[
    Path | None,
    typer.Option(
        "--output", "-o",
        help=f"folder of the raw data and the report [default: {OUTPUT}; with --quick {QUICK_OUTPUT}]",
    ),
]  # fmt: skip
AsJson = Annotated[bool, typer.Option("--json", help="print one JSON object on standard output")]


@app.callback()
def bench() -> None:
    """Run the published evaluation on this computer."""


@app.command()
def paper(
    only: Only = None,
    modes: Modes = None,
    runs: Runs = None,
    jobs: Jobs = None,
    quick: Quick = False,
    campaign: Campaigns = None,
    output: Output = None,
    as_json: AsJson = False,
) -> ExitCode:
    """Run the experiments of the paper (X1 to X7), and report our figures beside the published ones.

    Repeat the command to continue after an interruption. Exit codes: 0 no headline claim failed; 1 at least one
    failed. Details: docs/evaluation.md.
    """
    findings = Findings(json=as_json)
    empty = _empty(only=only, modes=modes)
    if empty:
        return findings.refuse(ExitCode.USAGE, "usage", f"`--{empty}` names nothing", "leave it out for all")
    folder = output or (QUICK_OUTPUT if quick else OUTPUT)
    request = EvaluationRequest(_names(only, upper=True), _names(modes), runs, jobs, quick, folder, campaign or ())
    made = service.prepare(request)
    if isinstance(made, Refusal):
        return findings.end(made)
    ended = _measure(made, quiet=as_json)
    if isinstance(ended, Refusal) and ended.slug not in ("interrupted", "io"):
        return findings.end(ended)
    written = service.report(made)
    for refused in (ended, written):
        if isinstance(refused, Refusal):
            return findings.end(refused)
    assert isinstance(ended, EvaluationOutcome)
    assert isinstance(written, WrittenReport)
    if not as_json:
        out(*_told(ended, written))
    claims = written.report.claims
    code = ExitCode.DIAGNOSTICS if claims.failed else ExitCode.FAULT if ended.failed else ExitCode.OK
    return findings.finish(code, folder=str(folder), **_summary(ended, written))


def _empty(**lists: str | None) -> str:
    """The name of an option that is there without a name in it; "" if there is none."""
    return next((name for name, given in lists.items() if given is not None and not _names(given)), "")


def _summary(ended: EvaluationOutcome, written: WrittenReport) -> dict[str, Any]:
    """What became of the evaluation, as the members of a JSON object."""
    claims = written.report.claims
    return {
        "report": str(written.page), "done": ended.done, "asked": ended.asked,
        "not_measured": [{"unit": _unit(each), "why": each.failed} for each in ended.failed],
        "not_counted": [{"experiment": name, "what": text} for name, text in written.not_counted],
        "claims": [each._asdict() for each in claims.claims],
        "targets": [each._asdict() for each in claims.targets],
    }  # fmt: skip


def _told(ended: EvaluationOutcome, written: WrittenReport) -> Sequence[str]:
    """The claims, the targets that were missed, and where the report is."""
    claims = written.report.claims
    lines = [
        f"{each.verdict:<18} {each.text}: {each.measured or 'no figure yet'} ({each.runs:,} of {each.planned:,} runs)"
        for each in claims.claims
        if each.runs
    ]
    lines += [written.report.verdict.replace("`", "")]
    lines += [f"{'target missed':<18} {each.text}" for each in claims.targets if each.verdict is ClaimVerdict.MISSED]
    lines += [f"{'not counted':<18} {name}: {text}" for name, text in written.not_counted]
    if ended.failed:
        first = ended.failed[0]
        lines.append(f"{len(ended.failed)} units of work failed, the first: {_unit(first)}: {first.failed}")
    return [*lines, f"{ended.done} of {ended.asked} units of work are done", f"report: {written.page}"]


def _measure(made: Evaluation, *, quiet: bool) -> EvaluationOutcome | Refusal:
    stop = StopRequest()
    progress = _Progress(made, quiet=quiet, stop=stop)
    try:
        return service.measure(made, progress, stop)
    except Stopped:
        kept = len(made.units) - len(made.left) + progress.done
        text = f"interrupted; {kept} of {len(made.units)} units of work are kept in `{made.folder.path}`"
        return Refusal("interrupted", text, "repeat the command to continue", ExitCode.INTERRUPTED)


def _names(text: str | None, *, upper: bool = False) -> tuple[str, ...]:
    """The names in a list with commas."""
    parts = (part.strip() for part in (text or "").split(","))
    return tuple(part.upper() if upper else part for part in parts if part)


class _Progress:
    """Shows the progress: one updated line on a terminal, otherwise at most a line each minute."""

    def __init__(self, made: Evaluation, *, quiet: bool, stop: StopRequest) -> None:
        self.done = 0
        self._before = len(made.units) - len(made.left)
        self._asked = len(made.units)
        self._stop = stop
        self._failed = 0
        self._shown_s = time.monotonic()
        self._shows = not quiet and sys.stderr is not None
        self._changes = self._shows and sys.stderr.isatty()

    def begun(self, made: Evaluation) -> None:
        """Say what is kept from an earlier run."""
        if self._shows and self._before > 0:
            say(f"{self._before} of {self._asked} units of work are kept in `{made.folder.path}`")

    def measured(self, found: UnitResults, left_s: float | None) -> None:
        """Show that a unit is done. Raises Stopped."""
        self.done += not found.failed
        self._failed += bool(found.failed)
        if self._shows and found.failed:
            self.clear()
            say(f"not measured: {_unit(found)}: {found.failed}")
        reached, now_s = self._before + self.done, time.monotonic()
        if self._changes or (self._shows and (now_s - self._shown_s >= _EVERY_S or reached == self._asked)):
            self._shown_s = now_s
            left = "" if left_s is None else f", {time_left(left_s)} left"
            self._say(f"{reached}/{self._asked}{left}: {_unit(found)}")
        self._stop.look()

    def clear(self) -> None:
        """Remove the progress line."""
        if self._changes:
            sys.stderr.write(_CLEAR)
            sys.stderr.flush()

    def _say(self, text: str) -> None:
        sys.stderr.write(f"{_CLEAR}{text[:79]}" if self._changes else f"{text}\n")
        sys.stderr.flush()


def _unit(found: UnitResults) -> str:
    return " ".join(map(str, (found.unit.experiment, *found.unit.key)))
