"""The service `campaign`: fly a mission many times with random faults, and keep the results in a folder."""

import os
import re
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, closing
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Final, NamedTuple, Protocol

from rtshcua import __version__, library
from rtshcua.app.exit_codes import words_of
from rtshcua.app.programs import compile_sources, no_source
from rtshcua.campaign.campaign_folder import CampaignFolder, CampaignIdentity
from rtshcua.campaign.campaign_report import CampaignSummary, summarise
from rtshcua.campaign.drawing import FLAVOURS, FaultSpace, answers_of
from rtshcua.campaign.rounds import CampaignFlight, CampaignOrder, CampaignResult, FlownMission, drawn, fly_rounds
from rtshcua.campaign.scenario_source import scenario_text
from rtshcua.campaign.shrinking import shrink
from rtshcua.campaign.workers import DaskWorkers, FlightWorkers, Here, WorkerProcesses, cores
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.span import Source
from rtshcua.diagnostics.suggest import nearest
from rtshcua.ground.pipeline.program import Compiled
from rtshcua.model.faults import KINDS
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.scenario import Scenario, Start
from rtshcua.onboard.ports import Ending
from rtshcua.virtual.flight import LATER_US

#: the number of different failures that are shrunk to a smallest flight
_SHRUNK: Final = 8
#: a scheduler address as Dask writes it; without a scheme it is `tcp`
_SCHEDULER: Final = re.compile(r"([a-z]+://)?[^\s/:]+:\d{1,5}", re.ASCII)


class CampaignRequest(NamedTuple):
    """Which mission is flown how often, on which autopilots, with which faults; by how many processes or on which
    cluster; in which folder the results are kept, and whether failing flights are shrunk.
    """

    source: Path
    further: Sequence[Path]
    mission: str | None
    flights: int
    seed: int
    flavours: tuple[str, ...]
    faults: Sequence[str]
    approve: bool
    issued_us: int | None
    jobs: int | None
    cluster: str | None
    output: Path | None
    shrinks: bool


class CampaignStart(NamedTuple):
    """A campaign before its sources were found free of errors; `begun` says what an earlier run began in the folder."""

    request: CampaignRequest
    kinds: frozenset[type]
    folder: CampaignFolder
    begun: CampaignIdentity | None
    issued_us: int
    compiled: Compiled
    sources: Mapping[str, Source]


class Campaign(NamedTuple):
    """A campaign that can be flown; `past` holds the results by the numbers of the flights."""

    request: CampaignRequest
    folder: CampaignFolder
    begun: bool
    identity: CampaignIdentity
    field: FlownMission
    space: FaultSpace
    past: dict[int, CampaignResult]


class CampaignProgress(Protocol):
    """Shows how far a campaign is. Each method may raise to stop it."""

    def begun(self, folder: CampaignFolder) -> None:
        """The flights begin."""

    def flown(self, result: CampaignResult) -> None:
        """A flight has finished, and its result is kept."""

    def shrinks(self, slug: str) -> None:
        """A failure is being shrunk."""

    def clear(self) -> None:
        """The flights are over."""


class CampaignStop(AbstractContextManager[object], Protocol):
    """Within it, `look` raises when the campaign is to stop."""

    def look(self) -> None:
        """Raise if it is to stop."""


def start(request: CampaignRequest) -> CampaignStart | Refusal:
    """Compile the mission of a campaign. Raises OSError."""
    kinds = _kinds(request.faults)
    if isinstance(kinds, Refusal):
        return kinds
    misused = _misused(request.source, request.cluster, request.jobs)
    if misused is not None:
        return misused
    named = f"campaign-{request.mission or request.source.stem}-{request.seed}"
    folder = CampaignFolder(request.output or Path("runs") / named)
    begun = folder.identity()
    if isinstance(begun, Refusal):
        return begun
    now_us = time.time_ns() // 1_000_000_000 * 1_000_000
    issued_us = request.issued_us or (now_us if begun is None else begun.issued_at_us)
    compiled, sources = compile_sources(
        [request.source, *request.further], mission=request.mission, issued_at_us=issued_us
    )
    return CampaignStart(request, kinds, folder, begun, issued_us, compiled, sources)


def prepare(start: CampaignStart, say: Callable[[str], None]) -> Campaign | Refusal:
    """Fly the mission once without faults on each autopilot; a refusal if it fails then, or the folder has another."""
    request, policy, mission = start.request, start.compiled.policy, start.compiled.mission
    assert policy is not None
    assert mission is not None
    flavours = tuple(dict.fromkeys(request.flavours)) or FLAVOURS
    field = FlownMission.of(policy, mission, start.issued_us)
    identity = CampaignIdentity(
        mission.name, start.issued_us, sha256(field.bundle).hexdigest(), request.seed, flavours,
        tuple(sorted(kind.__name__ for kind in start.kinds)), __version__, request.approve,
    )  # fmt: skip
    if start.begun is not None and start.begun != identity:
        return _other(start.folder, start.begun, identity)
    say(f"first flight without faults, on {' and '.join(flavours)}")
    space = _space(field, policy, mission, flavours, start.kinds, request.approve)
    if isinstance(space, Refusal):
        return space
    return Campaign(request, start.folder, start.begun is not None, identity, field, space, start.folder.past())


def fly(made: Campaign, progress: CampaignProgress, stop: CampaignStop) -> CampaignSummary | Refusal:
    """Fly what was not flown yet, shrink failing flights, and write the report. `progress` and `stop` may raise."""
    request, folder = made.request, made.folder
    try:
        workers = _workers(request, stop.look)
    except ImportError:
        help = "install it with the extra: `pip install 'rtshcua[cluster]'`"
        return Refusal("usage", "`--cluster` requires Dask, which is not installed", help)
    with closing(workers), stop:
        if not made.begun:
            try:
                folder.begin(made.identity)
            except OSError as error:
                return Refusal("io", f"cannot write to `{folder.path}`: {words_of(error)}", "", ExitCode.FULL)
        order = CampaignOrder(request.seed, request.flights, made.space)
        progress.begun(folder)

        def keep(result: CampaignResult) -> None:
            folder.keep(result)
            progress.flown(result)

        try:
            fly_rounds(order, made.field, workers, made.past, keep)
            if request.shrinks:
                folder.tell(_summary(made))
                _shrink(made, order, progress)
        finally:
            progress.clear()
            folder.tell(_summary(made))
    return _summary(made)


def _workers(request: CampaignRequest, look: Callable[[], None]) -> FlightWorkers:
    if request.cluster is not None:
        return DaskWorkers(request.cluster, look)
    jobs = request.jobs or cores()
    return Here() if jobs == 1 else WorkerProcesses(jobs, look)


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


def _shrink(made: Campaign, order: CampaignOrder, progress: CampaignProgress) -> None:
    """Save the smallest flight of each failure as a scenario, unless one is saved already."""
    folder, past, first = made.folder, made.past, dict[str, int]()
    imported = _imported(made.request.source, folder)
    for number in range(made.request.flights):
        for failed in past[number].failures:
            first.setdefault(failed.slug, number)
    for slug, number in list(first.items())[:_SHRUNK]:
        if folder.scenario(slug).exists():
            continue
        scenario = drawn(order, number, past).scenario

        def still(candidate: Scenario, slug: str = slug, number: int = number) -> bool:
            progress.shrinks(slug)
            return any(each.slug == slug for each in made.field.fly(CampaignFlight(number, candidate)).failures)

        small, _ = shrink(scenario, order.space.skills, still)
        small = replace(small, start=replace(small.start, utc_us=made.identity.issued_at_us + LATER_US))
        failed = next(each for each in past[number].failures if each.slug == slug)
        comment = f"{slug}: {failed.text}\nFlight {number} of campaign {order.seed}, shrunk."
        folder.save(slug, scenario_text(small, made.identity.mission, imported, comment))
    progress.clear()


def _summary(made: Campaign) -> CampaignSummary:
    """Return the summary of all flights in the folder, also if fewer are requested now."""
    slugs = {failed.slug for result in made.past.values() for failed in result.failures}
    kept = {slug: f"failures/{slug}.rts" for slug in slugs if made.folder.scenario(slug).exists()}
    return summarise(made.identity.mission, made.identity.seed, made.past, kept)
