"""The service `check`: the diagnostics of sources, the bounds of missions, and the differences between policies."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from rtshcua.adapters.store.reading import read_regular
from rtshcua.app.files import SOURCE, SPECIFICATION, source_files
from rtshcua.app.pictures import DrawnMissions, unfit_picture, unfit_place, write_page, write_picture
from rtshcua.app.programs import RootProgram, examine, keep_once, programs
from rtshcua.app.wording import many
from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.diagnostic import Diagnostic, has_errors
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.span import Source
from rtshcua.ground.prove.mission_bounds import Bounds
from rtshcua.ground.prove.survey_quality import StepPictures
from rtshcua.ground.report.policy_changes import describe_changes
from rtshcua.ground.report.report_model import ChangeView
from rtshcua.ground.versions.raised import compare
from rtshcua.model.flat.policy import Policy
from rtshcua.wire.bundle import MAX_BUNDLE
from rtshcua.wire.untrusted import Untrusted

#: yields programs one by one, and may show the current one
Progress = Callable[[Sequence[RootProgram]], Iterator[RootProgram]]


class CheckRequest(NamedTuple):
    """The paths to check, further sources, an earlier version to compare with, and the paths of a map and of a picture.
    With an `issued_at_us` of 0 the dates of zones are ignored. `as_json` means that standard output has an object.
    """

    paths: Sequence[Path]
    since: Path | None = None
    further: Sequence[Path] = ()
    map: Path | None = None
    issued_at_us: int = 0
    now_us: int = 0
    picture: Path | None = None
    as_json: bool = False


class CheckedMission(NamedTuple):
    """The bounds of a mission, the file that declares it, and the pictures of its surveys."""

    name: str
    file: str
    bounds: Bounds
    pictures: tuple[StepPictures, ...] = ()


class LeftOutCounts(NamedTuple):
    """The numbers of clauses and rules of a policy that are left out for a vehicle, and the signals that it lacks."""

    policy: str
    vehicle: str
    without: tuple[str, ...]
    clauses: int
    rules: int

    def told(self) -> str:
        """The numbers as text."""
        counted = ((self.clauses, "clause"), (self.rules, "rule"))
        counts = [many(count, what) for count, what in counted if count]
        without = ", ".join(self.without)
        return f"{self.policy} on {self.vehicle}: {' and '.join(counts)} `where fitted` left out, without {without}"


class ComparedPolicy(NamedTuple):
    """A policy with an earlier version: both version numbers, and the differences."""

    name: str
    version: int
    earlier: int
    changes: tuple[ChangeView, ...]


class CheckResult(NamedTuple):
    """The diagnostics, each once; and for programs without errors the bounds, version comparisons and left-out clauses.

    `now` are the errors that a mission without errors would have if issued now, because of zones with dates. `not_here`
    are the names of earlier policies without a counterpart in the sources.
    """

    diagnostics: tuple[Diagnostic, ...]
    sources: dict[str, Source]
    missions: tuple[CheckedMission, ...]
    versions: tuple[ComparedPolicy, ...]
    left_out: tuple[LeftOutCounts, ...]
    now: tuple[Diagnostic, ...]
    programs: tuple[RootProgram, ...] = ()
    not_here: tuple[str, ...] = ()


class EarlierPolicies(NamedTuple):
    """Earlier policies, and the name of their origin."""

    name: str
    policies: tuple[Policy, ...]


def check(request: CheckRequest, progress: Progress = iter) -> CheckResult | Refusal:
    """Check sources; an unusable request is refused. Raises OSError for a folder that cannot be read."""
    files = source_files(request.paths)
    if isinstance(files, Refusal):
        return files
    unfit = _unfit(request, files)
    if unfit is not None:
        return unfit
    earlier = EarlierPolicies("", ()) if request.since is None else earlier_policies(request.since)
    if isinstance(earlier, Refusal):
        return earlier
    roots = programs(files, tuple(request.further))
    found = check_all(progress(roots), earlier, request.issued_at_us, request.now_us)
    compared = {each.name for each in found.versions}
    gone = sorted({each.name for each in earlier.policies} - compared)
    return found._replace(programs=roots, not_here=tuple(gone))


def draw(found: CheckResult, request: CheckRequest) -> list[DrawnMissions] | Refusal:
    """Write the requested map and picture, in this order. Raises OSError."""
    from rtshcua.ground.report.mission_maps import CheckedMissions

    examined = [(each.reading.program, examine(each.reading, request.issued_at_us)) for each in found.programs]
    checked = [CheckedMissions(program.sources, one.planned, one.diagnostics) for program, one in examined]
    drawn: list[DrawnMissions] = []
    for target, write in ((request.map, write_page), (request.picture, write_picture)):
        one = None if target is None else write(target, checked, found.sources)
        if isinstance(one, Refusal):
            return one
        if one is not None:
            drawn.append(one)
    return drawn


def nothing_compared(found: CheckResult, since: Path) -> Refusal | None:
    """The refusal if no policy has an earlier version in `since`, because the user relies on the comparison."""
    if found.versions:
        return None
    there = f"there: {', '.join(f'`{name}`' for name in found.not_here)}"
    there = there if found.not_here else "it has no policy for a vehicle"
    help = (
        f"{there}; a policy with another name or for another vehicle is a different policy: name a bundle of "
        f"this policy"
    )
    return Refusal("since", f"nothing in `{since}` is an earlier version of a policy here", help)


def _unfit(request: CheckRequest, files: Sequence[Path]) -> Refusal | None:
    """The refusal if the requested map or picture cannot be written."""
    unfit = None if request.map is None else unfit_place(request.map, files, "a page")
    if unfit is not None or request.picture is None:
        return unfit
    if request.map is not None and request.map.resolve() == request.picture.resolve():
        return Refusal("output", f"`{request.picture}` cannot be both the map and the picture", "name two files")
    return unfit_picture(request.picture, files, as_json=request.as_json)


def earlier_policies(path: Path) -> EarlierPolicies | Refusal:
    """Read the policies of a bundle, without a check of its signatures, or of sources without errors."""
    if not path.is_dir() and path.suffix.lower() not in (SOURCE, SPECIFICATION):
        return _bundled(path)
    files = source_files([path])
    if isinstance(files, Refusal):
        return files
    policies: list[Policy] = []
    for each in programs(files):
        checked = examine(each.reading)
        if has_errors(checked.diagnostics):
            message = f"`{each.name}` has errors, so it cannot be compared"
            return Refusal("since", message, f"run `rtshcua check {path}`")
        policies += [lowered.policy for lowered in checked.policies]
    return EarlierPolicies(str(path), tuple(policies))


def _bundled(path: Path) -> EarlierPolicies | Refusal:
    try:
        data = read_regular(path, MAX_BUNDLE)
    except OSError as error:
        why = (error.strerror or "it is unreadable").lower()
        return Refusal("since", f"cannot read `{path}`: {why}")
    from rtshcua.app.documents import claimed  # brings cryptography

    try:
        return EarlierPolicies(str(path), (claimed(data).policy,))
    except Untrusted as error:
        return Refusal(error.slug, f"`{path}`: {error}", "accepted: a bundle, a source or a folder of sources")


def check_all(
    roots: Iterable[RootProgram], earlier: EarlierPolicies, issued_at_us: int = 0, now_us: int = 0
) -> CheckResult:
    """Check programs, and compare their policies with earlier ones.

    Without a time of issue the dates of zones are ignored. If one of these zones exists now, also report the errors of
    missions issued now.
    """
    now: dict[tuple[object, ...], Diagnostic] = {}
    found: dict[tuple[object, ...], Diagnostic] = {}
    sources: dict[str, Source] = {}
    missions: dict[tuple[str, str], CheckedMission] = {}
    versions: dict[tuple[str, int, int], dict[ChangeView, None]] = {}
    left_out: dict[LeftOutCounts, None] = {}
    for each in roots:
        program = each.reading.program
        checked = examine(each.reading, issued_at_us)
        sources |= program.sources
        compared = compare(checked.policies, earlier.policies, earlier.name, program.sources)
        for one in compared:
            changes = versions.setdefault((one.name, one.version, one.earlier), {})
            changes |= dict.fromkeys(describe_changes(one.old, one.new))
        left_out |= {_left_out(lowered.policy): None for lowered in checked.policies if lowered.policy.left_out}
        keep_once(found, (*checked.diagnostics, *(one.finding for one in compared if one.finding is not None)))
        if not issued_at_us and checked.bounds and any(_dated(one.policy, now_us) for one in checked.policies):
            wrong = [one for one in examine(each.reading, now_us).diagnostics if one.code.severity is Severity.ERROR]
            now |= {(one.code, one.span, one.message): one for one in wrong}
        files = {mission.name.text: unit.file for unit in program.units for mission in unit.missions}
        for name, bounds in checked.bounds.items():
            missions.setdefault((files[name], name), CheckedMission(name, files[name], bounds, checked.pictures[name]))
    return CheckResult(
        tuple(found.values()),
        sources,
        tuple(missions.values()),
        tuple(ComparedPolicy(*key, tuple(changes)) for key, changes in versions.items()),
        tuple(left_out),
        tuple(one for key, one in now.items() if key not in found),
    )


def _dated(policy: Policy, now_us: int) -> bool:
    """Whether a zone with dates exists now."""
    return any(zone.dates and zone.dates[0] <= now_us <= zone.dates[1] for zone in policy.zones)


def _left_out(policy: Policy) -> LeftOutCounts:
    rules = sum(each.skill < 0 for each in policy.left_out)
    vehicle = policy.vehicle
    return LeftOutCounts(policy.name, vehicle.name, vehicle.without, len(policy.left_out) - rules, rules)
