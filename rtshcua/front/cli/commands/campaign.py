"""`rtshcua campaign`: fly a mission many times in virtual time, with random faults."""

import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import typer

from rtshcua.app import campaigns as service
from rtshcua.app.campaigns import Campaign, CampaignRequest
from rtshcua.app.exit_codes import exit_code
from rtshcua.app.wording import moment
from rtshcua.campaign.campaign_folder import CampaignFolder
from rtshcua.campaign.campaign_report import CampaignSummary, as_json
from rtshcua.campaign.rounds import CampaignResult
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import say
from rtshcua.front.cli.interrupts import Stopped, StopRequest
from rtshcua.front.cli.render.findings import Findings
from rtshcua.front.cli.render.progress import time_left
from rtshcua.front.cli.stdout import out
from rtshcua.simulation.config import AutopilotKind

app = typer.Typer(add_completion=False)

_CLEAR: Final = "\r\033[K"

Source = Annotated[Path, typer.Argument(help="a source with a mission (.rts), or a mission specification (.json)")]
Flights = Annotated[int, typer.Option(min=1, max=10_000_000, help="number of flights")]
CampaignSeed = Annotated[int, typer.Option(min=0, help="seed of the campaign; the same seed gives the same flights")]
MissionName = Annotated[str | None, typer.Option(help="the mission to use if the source has several")]
FurtherSources = Annotated[
    list[Path] | None, typer.Option("--with", help="additional sources, such as a specification's policy (repeatable)")
]
Flavours = Annotated[list[AutopilotKind] | None, typer.Option(help="only this autopilot (repeatable) [default: both]")]
FaultKinds = Annotated[
    list[str] | None, typer.Option(metavar="KIND", help="only faults of this kind (repeatable) [default: all]")
]
Approve = Annotated[bool, typer.Option("--approve", help="grant every approval that a flight requests")]
IssuedAt = Annotated[str | None, typer.Option(help="time of issue, such as 2026-01-31T08:00:00Z [default: now]")]
Jobs = Annotated[
    int | None, typer.Option("--jobs", "-j", min=1, help="number of processes [default: one for each core]")
]
Cluster = Annotated[
    str | None,
    typer.Option(metavar="tcp://HOST:PORT", help="fly on the workers of this Dask scheduler (extra `cluster`)"),
]
Output = Annotated[
    Path | None, typer.Option("--output", "-o", help="folder of the campaign [default: runs/campaign-MISSION-SEED]")
]
NoShrink = Annotated[bool, typer.Option("--no-shrink", help="do not shrink failing flights")]
AsJson = Annotated[bool, typer.Option("--json", help="print one JSON object on standard output")]


@app.command()
def campaign(
    source: Source,
    flights: Flights = 200,
    seed: CampaignSeed = 1,
    mission: MissionName = None,
    with_: FurtherSources = None,
    flavour: Flavours = None,
    fault: FaultKinds = None,
    approve: Approve = False,
    at: IssuedAt = None,
    jobs: Jobs = None,
    cluster: Cluster = None,
    output: Output = None,
    quickly: NoShrink = False,
    as_json_: AsJson = False,
) -> ExitCode:
    """Fly a mission many times with random faults, and judge each flight by the true state of the simulated vehicle.

    Repeat the command to continue an interrupted campaign. Exit codes: 0 no flight failed; 13 at least one failed.
    Details: docs/flying/campaigns.md.
    """
    findings = Findings(json=as_json_)
    issued_us = None if at is None else moment(at)
    if at is not None and issued_us is None:
        return findings.refuse(ExitCode.USAGE, "usage", f"`{at}` is not a UTC time", "accepted: 2026-01-31T08:00:00Z")
    request = CampaignRequest(
        source, with_ or (), mission, flights, seed, tuple(map(str, flavour or ())), fault or (), approve, issued_us,
        jobs, cluster, output, not quickly,
    )  # fmt: skip
    start = service.start(request)
    if isinstance(start, Refusal):
        return findings.end(start)
    if findings.report(start.compiled.diagnostics, start.sources) or start.compiled.mission is None:
        return findings.finish(exit_code(start.compiled.diagnostics))
    made = service.prepare(start, lambda text: None if as_json_ else say(text))
    if isinstance(made, Refusal):
        return findings.end(made)
    ended = _fly(made, quiet=as_json_)
    if isinstance(ended, Refusal):
        return findings.end(ended)
    if not as_json_:
        out(*_told(ended, made.folder))
    return findings.finish(
        ExitCode.TESTS if ended.failures else ExitCode.OK, campaign=as_json(ended), folder=str(made.folder.path)
    )


def _fly(made: Campaign, *, quiet: bool) -> CampaignSummary | Refusal:
    flights, stop = made.request.flights, StopRequest()
    progress = _Progress(flights, sum(number < flights for number in made.past), quiet=quiet, stop=stop)
    try:
        return service.fly(made, progress, stop)
    except Stopped:
        text = f"interrupted; {len(made.past)} of {flights} flights are kept in `{made.folder.path}`"
        return Refusal("interrupted", text, "repeat the command to continue", ExitCode.INTERRUPTED)


def _told(summary: CampaignSummary, folder: CampaignFolder) -> list[str]:
    hours = summary.took_us / 3_600_000_000
    lines = []
    for each in summary.failures:
        lines.append(f"failed   {each.slug}: {each.flights} flight{'s' * (each.flights != 1)}, first {each.first[0]}")
        lines.append(f"         {each.text}")
        if each.scenario:
            lines.append(f"         {folder.path / each.scenario}")
    lines += [
        f"excused  {each.slug}: {each.flights} flight{'s' * (each.flights != 1)}, {each.why}"
        for each in summary.exceptions
    ]
    rate = f"{summary.flights / hours:.0f} an hour a core, " if hours else ""
    fast = f"{summary.flown_us / max(summary.took_us, 1):.0f} times real time"
    lines.append(f"{summary.flights} flights, {summary.failed} failed; {rate}{fast}")
    lines.append(f"report: {folder.report}")
    return lines


@dataclass
class _Progress:
    """Shows the progress: one updated line on a terminal, otherwise one line for each tenth."""

    flights: int
    before: int
    """Number of flights kept from an earlier run."""
    quiet: bool
    stop: StopRequest
    failed: int = 0
    done: int = 0
    told: int = 0

    def __post_init__(self) -> None:
        self.told = self.before * 10 // self.flights
        self._began_s = time.monotonic()
        self._shows = not self.quiet and sys.stderr is not None
        self._changes = self._shows and sys.stderr.isatty()

    def begun(self, folder: CampaignFolder) -> None:
        """Print the number of flights kept from an earlier run."""
        if self._shows and 0 < self.before < self.flights:
            say(f"{self.before} of {self.flights} flights are kept in `{folder.path}`; continuing with the next")

    def flown(self, result: CampaignResult) -> None:
        """Show that a flight has finished. Raises Stopped."""
        self.done += 1
        self.failed += bool(result.failures)
        reached = self.before + self.done
        if self._changes or (self._shows and reached * 10 // self.flights > self.told):
            self.told = reached * 10 // self.flights
            self._say(f"{reached}/{self.flights} flights, {self.failed} failed, {self._left(reached)} left")
        self.stop.look()

    def shrinks(self, slug: str) -> None:
        """Show that a failure is being shrunk. Raises Stopped."""
        self.stop.look()
        if self._changes:
            self._say(f"{slug}: searching for the smallest flight with this failure")

    def clear(self) -> None:
        """Remove the progress line."""
        if self._changes:
            sys.stderr.write(_CLEAR)
            sys.stderr.flush()

    def _left(self, reached: int) -> str:
        return time_left((time.monotonic() - self._began_s) / max(self.done, 1) * (self.flights - reached))

    def _say(self, text: str) -> None:
        sys.stderr.write(f"{_CLEAR}{text}" if self._changes else f"{text}\n")
        sys.stderr.flush()
