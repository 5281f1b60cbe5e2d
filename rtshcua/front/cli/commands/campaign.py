"""`rtshcua campaign`: thousands of flights of a mission, with faults that chance draws, in virtual time."""

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

#: of so many different failures the smallest flight is looked for
_SHRUNK: Final = 8
#: as Dask writes them; without a scheme it is `tcp`
_SCHEDULER: Final = re.compile(r"([a-z]+://)?[^\s/:]+:\d{1,5}", re.ASCII)
_CLEAR: Final = "\r\033[K"


@app.command()
def campaign(
    source: Annotated[Path, typer.Argument(help="a source with a mission (.rts), or a mission specification (.json)")],
    flights: Annotated[int, typer.Option(min=1, max=10_000_000, help="how many in all")] = 200,
    seed: Annotated[int, typer.Option(min=0, help="of the campaign: the same seed, the same flights")] = 1,
    mission: Annotated[str | None, typer.Option(help="which mission, where the source has several")] = None,
    with_: Annotated[
        list[Path] | None, typer.Option("--with", help="further sources: a specification's policy (repeatable)")
    ] = None,
    flavour: Annotated[
        list[AutopilotKind] | None, typer.Option(help="this autopilot alone (repeatable) [default: both]")
    ] = None,
    fault: Annotated[
        list[str] | None, typer.Option(metavar="KIND", help="faults of this kind alone (repeatable) [default: all]")
    ] = None,
    approve: Annotated[
        bool, typer.Option("--approve", help="in every flight, whoever is asked for an approval gives it")
    ] = False,
    at: Annotated[str | None, typer.Option(help="time of issue, such as 2026-01-31T08:00:00Z [default: now]")] = None,
    jobs: Annotated[int | None, typer.Option("--jobs", "-j", min=1, help="processes [default: one a core]")] = None,
    cluster: Annotated[
        str | None,
        typer.Option(metavar="tcp://HOST:PORT", help="a Dask scheduler, whose workers fly (extra `cluster`)"),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="its folder [default: runs/campaign-MISSION-SEED]")
    ] = None,
    quickly: Annotated[bool, typer.Option("--no-shrink", help="leave failures as they were drawn")] = False,
    as_json_: Annotated[bool, typer.Option("--json", help="one JSON object on the standard output")] = False,
) -> ExitCode:
    """Fly a mission thousands of times, each with other faults, and judge each flight by what really happened.

    A campaign that was interrupted goes on where it stopped, when the same is asked for again. Ends with 0 where no
    flight failed, 13 where one did. docs/flying/campaigns.md has it all.
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
        say(f"without faults first, on {' and '.join(flavours)}")
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
        return findings.refuse(ExitCode.USAGE, "usage", "`--cluster` needs Dask, which is not installed", help)
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
    """What makes no sense of what was asked for, before anything is read or flown."""
    if cluster is not None and jobs is not None:
        return Refusal("usage", "`--jobs` is for this machine, and `--cluster` for others")
    if cluster is not None and not _SCHEDULER.fullmatch(cluster):
        return Refusal("usage", f"`{cluster}` is no address of a Dask scheduler", "write it as `tcp://10.0.0.1:8786`")
    return no_source(source)


def _here(jobs: int, stop: StopRequest) -> FlightWorkers:
    return Here() if jobs == 1 else WorkerProcesses(jobs, stop.look)


def _kinds(names: Sequence[str]) -> frozenset[type] | Refusal:
    unknown = [name for name in names if name.replace("_", "-") not in KINDS]
    if unknown:
        near = nearest(unknown[0], KINDS)
        help = f"did you mean `{near}`?" if near else f"there are {', '.join(KINDS)}"
        return Refusal("usage", f"no such fault: `{unknown[0]}`", help)
    return frozenset(KINDS[name.replace("_", "-")] for name in names) or frozenset(KINDS.values())


def _other(folder: CampaignFolder, begun: CampaignIdentity, asked: CampaignIdentity) -> Refusal:
    words = {
        "bundle": "another bundle (its sources changed)",
        "flavours": "other kinds of autopilots",
        "kinds": "other kinds of faults",
        "version": "another version of this program",
        "issued_at_us": "another time of issue",
        "approved": "another choice of `--approve`",
    }
    differ = [name for name in CampaignIdentity.__struct_fields__ if getattr(begun, name) != getattr(asked, name)]
    what = " and ".join(words.get(name, f"another {name}") for name in differ)
    help = "give another folder with `-o`, or take this one away"
    return Refusal("usage", f"`{folder.path}` holds a campaign with {what}", help)


def _space(
    field: FlownMission,
    policy: Policy,
    mission: Mission,
    flavours: tuple[str, ...],
    kinds: frozenset[type],
    approve: bool,
) -> FaultSpace | Refusal:
    """What is drawn from: how long the mission takes where nothing goes wrong, on each kind of autopilot."""
    lasts = {}
    roles = sorted({policy.roles[role] for rule in policy.rules for role in (rule.approver, rule.second) if role >= 0})
    asked = tuple(answers_of(policy, mission))
    answers = asked if approve else ()
    for each in flavours:
        calm = field.fly(CampaignFlight(0, Scenario("nothing goes wrong", (each,), 1, 1, Start(), answers, ())))
        wrong = f"fails even if nothing goes wrong: {calm.failures[0].text}" if calm.failures else None
        if wrong is None and calm.ending != Ending.COMPLETED:
            wrong = f"ends as `{calm.ending}` even if nothing goes wrong"
        if wrong is not None:
            help = "see it with `rtshcua run`; a campaign looks for what faults do to a flight that is good without"
            if asked and not approve:
                help += ". Nobody approves anything in it; with `--approve` whoever is asked does"
            return Refusal("not-flown", f"on {each} the mission {wrong}", help)
        lasts[each] = calm.flown_us
    skills = tuple(policy.contracts[each.skill].name for each in mission.invocations)
    read = sorted({source.message for signal in policy.signals for source in signal.sources})
    return FaultSpace(skills, lasts, tuple(roles), flavours, kinds, tuple(read), answers)


def _imported(source: Path, folder: CampaignFolder) -> str:
    """How a scenario in the folder imports the mission."""
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
    """Keep the smallest flight of each failure as a scenario, if none is kept yet."""
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
        comment = f"{slug}: {failed.text}\nFlight {number} of campaign {order.seed}, as small as it still fails."
        folder.save(slug, scenario_text(small, identity.mission, imported, comment))
    progress.clear()


def _summary(identity: CampaignIdentity, past: Mapping[int, CampaignResult], folder: CampaignFolder) -> CampaignSummary:
    """Of all that the folder has, also where fewer are asked for this time."""
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
    """How far it is, for a person who waits: on a terminal a line that changes, else one for each tenth."""

    flights: int
    before: int
    """How many were flown when it began."""
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
        """What was flown before is told."""
        if self._shows and 0 < self.before < self.flights:
            say(f"{self.before} of {self.flights} flights are kept in `{folder.path}`: it goes on behind them")

    def flown(self, result: CampaignResult, folder: CampaignFolder) -> None:
        """A flight is over; it is kept. Raises Stopped."""
        folder.keep(result)
        self.done += 1
        self.failed += bool(result.failures)
        reached = self.before + self.done
        if self._changes or (self._shows and reached * 10 // self.flights > self.told):
            self.told = reached * 10 // self.flights
            self._say(f"{reached}/{self.flights} flights, {self.failed} failed, {self._left(reached)} left")
        self.stop.look()

    def shrinks(self, slug: str) -> None:
        """Another flight is flown to make a failure small. Raises Stopped."""
        self.stop.look()
        if self._changes:
            self._say(f"{slug}: looking for the smallest flight that fails so")

    def clear(self) -> None:
        """Nothing more is to be said."""
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
