"""`rtshcua campaign`: fly a mission many times in virtual time, with random faults."""

import os
import re
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Final

import typer

from rtshcua import __version__, library
from rtshcua.app.exit_codes import exit_code, words_of
from rtshcua.app.programs import compile_sources, no_source
from rtshcua.app.wording import moment
from rtshcua.campaign.campaign_folder import CampaignFolder, CampaignIdentity
from rtshcua.campaign.campaign_report import CampaignSummary, as_json, summarise
from rtshcua.campaign.drawing import FLAVOURS, FaultSpace, answers_of
from rtshcua.campaign.rounds import CampaignFlight, CampaignOrder, CampaignResult, FlownMission, drawn, fly_rounds
from rtshcua.campaign.scenario_source import scenario_text
from rtshcua.campaign.shrinking import shrink
from rtshcua.campaign.workers import DaskWorkers, FlightWorkers, Here, WorkerProcesses, cores
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.suggest import nearest
from rtshcua.front.cli.faults import say
from rtshcua.front.cli.interrupts import Stopped, StopRequest
from rtshcua.front.cli.render.findings import Findings
from rtshcua.front.cli.stdout import out
from rtshcua.model.faults import KINDS
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.scenario import Scenario, Start
from rtshcua.onboard.ports import Ending
from rtshcua.simulation.config import AutopilotKind
from rtshcua.virtual.flight import LATER_US

app = typer.Typer(add_completion=False)

#: the number of different failures that are shrunk to a smallest flight
_SHRUNK: Final = 8
#: a scheduler address as Dask writes it; without a scheme it is `tcp`
_SCHEDULER: Final = re.compile(r"([a-z]+://)?[^\s/:]+:\d{1,5}", re.ASCII)
_CLEAR: Final = "\r\033[K"


@app.command()
def campaign(
    source: Annotated[Path, typer.Argument(help="a source with a mission (.rts), or a mission specification (.json)")],
    flights: Annotated[int, typer.Option(min=1, max=10_000_000, help="number of flights")] = 200,
    seed: Annotated[int, typer.Option(min=0, help="seed of the campaign; the same seed gives the same flights")] = 1,
    mission: Annotated[str | None, typer.Option(help="the mission to use if the source has several")] = None,
    with_: Annotated[
        list[Path] | None,
        typer.Option("--with", help="additional sources, such as a specification's policy (repeatable)"),
    ] = None,
    flavour: Annotated[
        list[AutopilotKind] | None, typer.Option(help="only this autopilot (repeatable) [default: both]")
    ] = None,
    fault: Annotated[
        list[str] | None, typer.Option(metavar="KIND", help="only faults of this kind (repeatable) [default: all]")
    ] = None,
    approve: Annotated[bool, typer.Option("--approve", help="grant every approval that a flight requests")] = False,
    at: Annotated[str | None, typer.Option(help="time of issue, such as 2026-01-31T08:00:00Z [default: now]")] = None,
    jobs: Annotated[
        int | None, typer.Option("--jobs", "-j", min=1, help="number of processes [default: one for each core]")
    ] = None,
    cluster: Annotated[
        str | None,
        typer.Option(metavar="tcp://HOST:PORT", help="fly on the workers of this Dask scheduler (extra `cluster`)"),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="folder of the campaign [default: runs/campaign-MISSION-SEED]")
    ] = None,
    quickly: Annotated[bool, typer.Option("--no-shrink", help="do not shrink failing flights")] = False,
    as_json_: Annotated[bool, typer.Option("--json", help="print one JSON object on standard output")] = False,
) -> ExitCode:
    """Fly a mission many times with random faults, and judge each flight by the true state of the simulated vehicle.

    Repeat the command to continue an interrupted campaign. Exit codes: 0 no flight failed; 13 at least one failed.
    Details: docs/flying/campaigns.md.
    """
    findings = Findings(json=as_json_)
    kinds = _kinds(fault or ())
    if isinstance(kinds, Refusal):
        return findings.end(kinds)
    asked_us = None if at is None else moment(at)
    if at is not None and asked_us is None:
        return findings.refuse(ExitCode.USAGE, "usage", f"`{at}` is not a UTC time", "accepted: 2026-01-31T08:00:00Z")
    misused = _misused(source, cluster, jobs)
    if misused is not None:
        return findings.end(misused)
    flavours = tuple(dict.fromkeys(str(each) for each in flavour or ())) or FLAVOURS
    folder = CampaignFolder(output or Path("runs") / f"campaign-{mission or source.stem}-{seed}")
    begun = folder.identity()
    if isinstance(begun, Refusal):
        return findings.end(begun)
    issued_us = asked_us or (begun.issued_at_us if begun is not None else time.time_ns() // 1_000_000_000 * 1_000_000)
    compiled, sources = compile_sources([source, *(with_ or ())], mission=mission, issued_at_us=issued_us)
    if findings.report(compiled.diagnostics, sources) or compiled.policy is None or compiled.mission is None:
        return findings.finish(exit_code(compiled.diagnostics))
    field = FlownMission.of(compiled.policy, compiled.mission, issued_us)
    identity = CampaignIdentity(
        compiled.mission.name, issued_us, sha256(field.bundle).hexdigest(), seed, flavours,
        tuple(sorted(kind.__name__ for kind in kinds)), __version__, approve,
    )  # fmt: skip
    if begun is not None and begun != identity:
        return findings.end(_other(folder, begun, identity))
    if not as_json_:
        say(f"first flight without faults, on {' and '.join(flavours)}")
    space = _space(field, compiled.policy, compiled.mission, flavours, kinds, approve)
    if isinstance(space, Refusal):
        return findings.end(space)
    stop = StopRequest()
    try:
        workers: FlightWorkers = (
            DaskWorkers(cluster, stop.look) if cluster is not None else _here(jobs or cores(), stop)
        )
    except ImportError:
        help = "install it with the extra: `pip install 'rtshcua[cluster]'`"
        return findings.refuse(ExitCode.USAGE, "usage", "`--cluster` requires Dask, which is not installed", help)
    with closing(workers), stop:
        if begun is None:
            try:
                folder.begin(identity)
            except OSError as error:
                return findings.refuse(ExitCode.FULL, "io", f"cannot write to `{folder.path}`: {words_of(error)}")
        order = CampaignOrder(seed, flights, space)
        past = folder.past()
        progress = _Progress(flights, sum(number < flights for number in past), quiet=as_json_, stop=stop)
        progress.begun(folder)
        try:
            fly_rounds(order, field, workers, past, lambda result: progress.flown(result, folder))
            wanted = {number: past[number] for number in range(flights)}
            if not quickly:
                folder.tell(_summary(identity, past, folder))
                _shrink(order, field, wanted, past, folder, identity, _imported(source, folder), progress)
        except Stopped:
            text = f"interrupted; {len(past)} of {flights} flights are kept in `{folder.path}`"
            return findings.refuse(ExitCode.INTERRUPTED, "interrupted", text, "repeat the command to continue")
        finally:
            progress.clear()
            folder.tell(_summary(identity, past, folder))
    summary = _summary(identity, past, folder)
    if not as_json_:
        out(*_told(summary, folder))
    return findings.finish(
        ExitCode.TESTS if summary.failures else ExitCode.OK, campaign=as_json(summary), folder=str(folder.path)
    )


def _misused(source: Path, cluster: str | None, jobs: int | None) -> Refusal | None:
    """Return the refusal for options that conflict or are malformed; None if they are valid."""
    if cluster is not None and jobs is not None:
        return Refusal(
            "usage",
            "`--jobs` and `--cluster` cannot be combined",
            "the cluster's workers decide how many flights run at once",
        )
    if cluster is not None and not _SCHEDULER.fullmatch(cluster):
        return Refusal(
            "usage", f"`{cluster}` is not the address of a Dask scheduler", "write it as `tcp://10.0.0.1:8786`"
        )
    return no_source(source)


def _here(jobs: int, stop: StopRequest) -> FlightWorkers:
    return Here() if jobs == 1 else WorkerProcesses(jobs, stop.look)


def _kinds(names: Sequence[str]) -> frozenset[type] | Refusal:
    unknown = [name for name in names if name.replace("_", "-") not in KINDS]
    if unknown:
        near = nearest(unknown[0], KINDS)
        help = f"did you mean `{near}`?" if near else f"accepted: {', '.join(KINDS)}"
        return Refusal("usage", f"no such fault: `{unknown[0]}`", help)
    return frozenset(KINDS[name.replace("_", "-")] for name in names) or frozenset(KINDS.values())


def _other(folder: CampaignFolder, begun: CampaignIdentity, asked: CampaignIdentity) -> Refusal:
    words = {
        "bundle": "a different bundle (its sources changed)",
        "flavours": "different autopilots",
        "kinds": "different kinds of faults",
        "version": "a different version of this program",
        "issued_at_us": "a different time of issue",
        "approved": "a different setting of `--approve`",
    }
    differ = [name for name in CampaignIdentity.__struct_fields__ if getattr(begun, name) != getattr(asked, name)]
    what = " and ".join(words.get(name, f"a different {name}") for name in differ)
    help = "choose another folder with `-o`, or remove this one"
    return Refusal("usage", f"`{folder.path}` holds a campaign with {what}", help)


def _space(
    field: FlownMission,
    policy: Policy,
    mission: Mission,
    flavours: tuple[str, ...],
    kinds: frozenset[type],
    approve: bool,
) -> FaultSpace | Refusal:
    """Return the space that faults are drawn from, or a refusal if the mission fails without faults.

    Flies the mission once without faults on each autopilot.
    """
    lasts = {}
    roles = sorted({policy.roles[role] for rule in policy.rules for role in (rule.approver, rule.second) if role >= 0})
    asked = tuple(answers_of(policy, mission))
    answers = asked if approve else ()
    for each in flavours:
        calm = field.fly(CampaignFlight(0, Scenario("nothing goes wrong", (each,), 1, 1, Start(), answers, ())))
        wrong = f"fails without faults: {calm.failures[0].text}" if calm.failures else None
        if wrong is None and calm.ending != Ending.COMPLETED:
            wrong = f"ends as `{calm.ending}` without faults"
        if wrong is not None:
            help = "reproduce it with `rtshcua run`; a campaign requires a mission that succeeds without faults"
            if asked and not approve:
                help += ". No approval was granted; `--approve` grants all"
            return Refusal("not-flown", f"on {each} the mission {wrong}", help)
        lasts[each] = calm.flown_us
    skills = tuple(policy.contracts[each.skill].name for each in mission.invocations)
    read = sorted({source.message for signal in policy.signals for source in signal.sources})
    return FaultSpace(skills, lasts, tuple(roles), flavours, kinds, tuple(read), answers)


def _imported(source: Path, folder: CampaignFolder) -> str:
    """Return the import path of the mission for scenarios in the folder."""
    shipped = library.root().resolve()
    path = source.resolve()
    if path.is_relative_to(shipped):
        return f"lib:{path.relative_to(shipped).as_posix()}"
    return Path(os.path.relpath(path, folder.path.resolve() / "failures")).as_posix()


def _shrink(
    order: CampaignOrder, field: FlownMission, wanted: Mapping[int, CampaignResult], past: Mapping[int, CampaignResult],
    folder: CampaignFolder,
    identity: CampaignIdentity, imported: str, progress: "_Progress",
) -> None:  # fmt: skip
    """Save the smallest flight of each failure as a scenario, unless one is saved already."""
    first: dict[str, int] = {}
    for number in sorted(wanted):
        for failed in wanted[number].failures:
            first.setdefault(failed.slug, number)
    for slug, number in list(first.items())[:_SHRUNK]:
        if folder.scenario(slug).exists():
            continue
        scenario = drawn(order, number, past).scenario

        def still(candidate: Scenario, slug: str = slug, number: int = number) -> bool:
            progress.shrinks(slug)
            return any(each.slug == slug for each in field.fly(CampaignFlight(number, candidate)).failures)

        small, _ = shrink(scenario, order.space.skills, still)
        small = replace(small, start=replace(small.start, utc_us=identity.issued_at_us + LATER_US))
        failed = next(each for each in wanted[number].failures if each.slug == slug)
        comment = f"{slug}: {failed.text}\nFlight {number} of campaign {order.seed}, shrunk."
        folder.save(slug, scenario_text(small, identity.mission, imported, comment))
    progress.clear()


def _summary(identity: CampaignIdentity, past: Mapping[int, CampaignResult], folder: CampaignFolder) -> CampaignSummary:
    """Return the summary of all flights in the folder, also if fewer are requested now."""
    slugs = {failed.slug for result in past.values() for failed in result.failures}
    kept = {slug: f"failures/{slug}.rts" for slug in slugs if folder.scenario(slug).exists()}
    return summarise(identity.mission, identity.seed, past, kept)


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

    def flown(self, result: CampaignResult, folder: CampaignFolder) -> None:
        """Keep the result of a finished flight. Raises Stopped."""
        folder.keep(result)
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
        seconds = (time.monotonic() - self._began_s) / max(self.done, 1) * (self.flights - reached)
        minutes = round(seconds / 60)
        return (
            f"{minutes // 60} h {minutes % 60} min" if minutes >= 60 else f"{minutes} min" if minutes else "under 1 min"
        )

    def _say(self, text: str) -> None:
        sys.stderr.write(f"{_CLEAR}{text}" if self._changes else f"{text}\n")
        sys.stderr.flush()
