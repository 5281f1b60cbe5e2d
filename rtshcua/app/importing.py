"""The service `import`: a file of the trade as a source of the language, with everything that it leaves out."""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from pathlib import Path
from typing import Any, Final, NamedTuple

from rtshcua.adapters.store.reading import read_regular
from rtshcua.adapters.store.writing import write_new
from rtshcua.app.exit_codes import words_of
from rtshcua.app.programs import examine, read_text
from rtshcua.app.propose import Missions, NoPolicy
from rtshcua.decision.prepare import prepare
from rtshcua.diagnostics.diagnostic import Diagnostic, has_errors
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.kinds import ARCHIVE, ED269, GEOJSON, KML, PLAN, recognised
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.span import Source
from rtshcua.diagnostics.suggest import listed, nearest
from rtshcua.ground.checker.geojson import NoArea, read_json, refuse_unread
from rtshcua.ground.exchange.geojson_features import (
    features_of,
    is_ed269,
    is_ed269_feature,
    is_ed318,
    is_point,
    read_feature,
    read_point,
)
from rtshcua.ground.exchange.kml_document import kml_of, read_kml
from rtshcua.ground.exchange.kml_zones import zones_of_kml
from rtshcua.ground.exchange.losses import LOSSES, Loss, NotKept, NotReadable, comment, grouped, left_out
from rtshcua.ground.exchange.plan_source import MissionHeader, draft_policy, fence_zones, mission_text
from rtshcua.ground.exchange.plan_steps import StepTable, plan_steps, without_jumps
from rtshcua.ground.exchange.plan_surveys import CoveredSurvey, cover_survey, covered_plan
from rtshcua.ground.exchange.qgc_reading import QgcPlan, read_plan_file
from rtshcua.ground.exchange.qgc_surveys import NoSurvey, QgcSurvey
from rtshcua.ground.exchange.stock_policy import VEHICLE, GeoPoint
from rtshcua.ground.exchange.zone_features import INSIDE, OUTSIDE, ZoneFeature, ZoneTerms, write_zones
from rtshcua.ground.exchange.zone_source import SourceNames, place_text
from rtshcua.ground.format.format_text import format_text
from rtshcua.ground.gateway.accepted import accepted_commands
from rtshcua.ground.language.paths import shown
from rtshcua.ground.language.size_limits import MAX_SIZE
from rtshcua.mavlink import dialect

ZONES, MISSION = "zones", "mission"
TARGETS: Final = (ZONES, MISSION)
PROPOSERS: Final = ("operator", "agent")
#: what plain areas are for
USES: Final = (OUTSIDE, INSIDE)
#: the packages of the extra `import`
_EXTRA: Final = ("uas_standards", "implicitdict")
#: errors about charge and time: the legs of a survey take no less
_OF_CHARGE: Final = frozenset({"E0614", "E0620", "E0804", "E0809", "E0812", "E0814", "E0815"})
#: the name of a source that is not written to a file
_UNNAMED: Final = "imported.rts"
#: the kind of a file that does not show it by its first bytes
_BY_SUFFIX: Final = {".plan": PLAN, ".kml": KML, ".kmz": ARCHIVE, ".geojson": GEOJSON, ".json": GEOJSON}
SUFFIXES: Final = tuple(_BY_SUFFIX)
_TERRAIN: Final = re.compile(r"(-?[0-9]{1,4}(?:\.[0-9]{1,3})?)\.\.(-?[0-9]{1,4}(?:\.[0-9]{1,3})?)")
_CLOCK: Final = re.compile(r"utc|(?:utc ?)?([+-])([01]?[0-9]):([0-5][0-9])")
_WIDTH: Final = re.compile(r"([1-9][0-9]{0,4}(?:\.[0-9]{1,3})?)(?: ?m)?")
#: how many places of one loss, and how many parts that are not kept, are printed
_MOST_PLACES, _MOST_TOLD = 3, 20


#: options that apply to areas alone, and to missions alone, by their fields
_OF_AREAS: Final = {"use": "--as", "terrain": "--terrain", "clock": "--clock", "width": "--width"}
_OF_MISSIONS: Final = {"policy": "--policy", "proposer": "--proposer", "legs": "--legs"}


class ImportRequest(NamedTuple):
    """A file, what is made of it (empty: what its kind usually is), the source to write (None: none), the source with
    the policy of a mission, what is left out, and who proposes a mission. Of zones: what plain areas are for, the
    lowest and the highest ground (`400..460`, in m above sea), the offset of the vehicle's clock (`+02:00`), and the
    width of lines in m; empty where nothing is stated. `legs` keeps the planner's legs of surveys.
    """

    file: Path
    to: str = ""
    output: Path | None = None
    policy: Path | None = None
    skip: Sequence[str] = ()
    proposer: str = "operator"
    use: str = OUTSIDE
    terrain: str = ""
    clock: str = ""
    width: str = ""
    legs: bool = False


class ImportedSource(NamedTuple):
    """A source: its text, the number of its zones and steps, what was lost and what a person left out, and the
    findings of the checker. `not_kept` is not empty if it is refused; then there is no text.
    """

    kind: str
    to: str
    text: str
    zones: int
    steps: int
    losses: tuple[Loss, ...]
    not_kept: tuple[NotKept, ...]
    left_out: tuple[NotKept, ...]
    rules: tuple[str, ...] = ()
    diagnostics: tuple[Diagnostic, ...] = ()
    sources: Mapping[str, Source] = {}

    @property
    def code(self) -> ExitCode:
        """The exit code."""
        return ExitCode.DIAGNOSTICS if self.not_kept or has_errors(self.diagnostics) else ExitCode.OK

    def told(self) -> Iterator[str]:
        """What is lost, left out and not kept, in lines for a person; a line that begins with a space is a detail."""
        for group in grouped(self.losses):
            yield f"lost: {group.name} ({len(group.losses)}): {group.consequence}"
            yield from _places([(each.place, each.what) for each in group.losses])
        for word, some in (("left out", self.left_out), ("error", self.not_kept)):
            for each in some[:_MOST_TOLD]:
                yield f"{word}: {each.name} at {each.place}: {each.why}"
                if word == "error" and each.help:
                    yield f"  help: {each.help}"
            if len(some) > _MOST_TOLD:
                yield f"{word}: {len(some) - _MOST_TOLD} more; `--json` has all"
        if self.not_kept:
            yield "nothing is written: correct the file, or leave parts out with `--skip NAME` (`--skip all`)"

    def as_object(self) -> dict[str, object]:
        """The same as members of a JSON object."""
        return {
            "kind": self.kind,
            "to": self.to,
            "zones": self.zones,
            "steps": self.steps,
            "rules": list(self.rules),
            "losses": [each._asdict() | {"consequence": LOSSES[each.name]} for each in self.losses],
            "left_out": [each._asdict() for each in self.left_out],
            "not_kept": [each._asdict() for each in self.not_kept],
        }


def _places(found: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Some places of a loss, with what is there."""
    for place, what in found[:_MOST_PLACES]:
        yield f"  {place}  {what}"
    if len(found) > _MOST_PLACES:
        yield f"  and {len(found) - _MOST_PLACES} more"


class _Checked(NamedTuple):
    """A formatted text with the findings of the checker."""

    text: str
    diagnostics: tuple[Diagnostic, ...]
    sources: Mapping[str, Source]


class _Made(NamedTuple):
    """A text before it is checked; `checked` if it was checked already."""

    text: str
    zones: int
    steps: int
    losses: tuple[Loss, ...]
    not_kept: tuple[NotKept, ...]
    rules: tuple[str, ...] = ()
    checked: _Checked | None = None


def import_file(request: ImportRequest) -> ImportedSource | Refusal:
    """Read a file, write the source, and check it. Raises OSError if the source cannot be written."""
    refusal = _unfit(request)
    if refusal is not None:
        return refusal
    try:
        data = read_regular(request.file, MAX_SIZE)
    except OSError as error:
        return Refusal("input", f"cannot read `{request.file}`: {words_of(error)}", "", ExitCode.INPUT)
    if len(data) > MAX_SIZE:
        return _unread(request, f"it has more than {MAX_SIZE >> 20} MiB", "remove the parts that are not needed")
    terms = _terms(request)
    if isinstance(terms, Refusal):
        return terms
    try:
        return _by_kind(request, terms, data)
    except NotReadable as error:
        return _unread(request, str(error), error.help)


def _by_kind(request: ImportRequest, terms: ZoneTerms, data: bytes) -> ImportedSource | Refusal:
    """Import a file of any kind. Raises `NotReadable`."""
    kind = recognised(data) or _BY_SUFFIX.get(request.file.suffix.lower())
    if kind is PLAN:
        return _imported_plan(request, read_plan_file(data))
    if request.to == MISSION:
        return _unread(request, "only a plan becomes a mission", "`--to zones` imports areas")
    unused = _unused(request, _OF_MISSIONS, "the mission of a plan")
    if unused is not None:
        return unused
    if kind is ARCHIVE:
        data, kind = kml_of(data), KML
    if kind is KML:
        found = zones_of_kml(read_kml(data), terms.width, request.use)
        return _imported_zones(request, terms, "kml", found.features, found.losses, found.not_kept)
    if kind in (GEOJSON, ED269):
        return _imported_json(request, terms, data)
    name = "no file that can be imported" if kind is None else kind.name
    return _unread(request, f"it is {name}", f"imported are {listed(SUFFIXES)}")


def _terms(request: ImportRequest) -> ZoneTerms | Refusal:
    """What is stated about the site."""
    terrain = _TERRAIN.fullmatch(request.terrain)
    clock = _CLOCK.fullmatch(request.clock)
    width = _WIDTH.fullmatch(request.width)
    for word, found, option, example in (
        (request.terrain, terrain, "--terrain", "400..460"),
        (request.clock, clock, "--clock", "+02:00"),
        (request.width, width, "--width", "20"),
    ):
        if word and found is None:
            return Refusal("usage", f"`{word}` is not accepted by `{option}`", f"as in `{option} {example}`")
    ground = None if terrain is None else (_mm(terrain[1]), _mm(terrain[2]))
    if ground is not None and ground[0] > ground[1]:
        return Refusal("usage", f"`--terrain {request.terrain}`: the lowest ground comes first")
    offset = None
    if clock is not None:
        offset = (int(clock[2] or 0) * 60 + int(clock[3] or 0)) * (-1 if clock[1] == "-" else 1)
    return ZoneTerms(ground, offset, None if width is None else _mm(width[1]))


def _mm(metres: str) -> int:
    return round(Decimal(metres) * 1000)


def _unfit(request: ImportRequest) -> Refusal | None:
    """Why the command line cannot be followed."""
    for word, known, option in (
        (request.to, ("", *TARGETS), "--to"),
        (request.proposer, PROPOSERS, "--proposer"),
        (request.use, USES, "--as"),
    ):
        if word not in known:
            near = nearest(word, known)
            help = f"did you mean `{near}`?" if near else f"accepted: {listed([each for each in known if each])}"
            return Refusal("usage", f"`{word}` is not accepted by `{option}`", help)
    if request.output is None:
        return None
    if request.output.suffix != ".rts":
        return Refusal("output", f"`{request.output}` does not end in `.rts`", "a source ends in `.rts`")
    if request.output.exists() or request.output.is_symlink():
        help = "name another file: an import never replaces a source"
        return Refusal("output", f"`{request.output}` exists", help)
    if not request.output.parent.is_dir():
        return Refusal("output", f"there is no folder `{request.output.parent}` to write to", "", ExitCode.INPUT)
    return None


def _unused(request: ImportRequest, options: Mapping[str, str], what: str) -> Refusal | None:
    """Why an option is refused that a file of this kind has no use for: its user would believe that it was followed."""
    for field, option in options.items():
        if getattr(request, field) != ImportRequest._field_defaults[field]:
            return Refusal("usage", f"`{option}` applies to {what} alone", f"leave out `{option}`")
    return None


def _unread(request: ImportRequest, text: str, help: str = "") -> Refusal:
    return Refusal("not-imported", f"`{request.file}`: {text}", help, ExitCode.INPUT)


def _finished(request: ImportRequest, kind: str, to: str, made: _Made | Refusal) -> ImportedSource | Refusal:
    """Leave out what a person left out, write the source, and check it."""
    if isinstance(made, Refusal):
        return made
    remaining, skipped, unknown = left_out(made.not_kept, request.skip)
    if unknown:
        names = [each.name for each in made.not_kept]
        near = nearest(unknown[0], names)
        help = f"did you mean `{near}`?" if near else "the import names what it cannot keep"
        return Refusal("usage", f"`--skip {unknown[0]}` names nothing that is refused", help)
    if remaining:
        return ImportedSource(kind, to, "", 0, 0, made.losses, tuple(remaining), tuple(skipped))
    checked = made.checked or _check(request, made.text)
    if request.output is not None:
        write_new(request.output, checked.text.encode())
    return ImportedSource(
        kind, to, checked.text, made.zones, made.steps, made.losses, (), tuple(skipped), made.rules,
        checked.diagnostics, checked.sources,
    )  # fmt: skip


def _check(request: ImportRequest, text: str) -> _Checked:
    """Format and check a text, as the source that is to be written."""
    formatted = format_text(text)
    text = formatted if isinstance(formatted, str) else text
    name = _UNNAMED if request.output is None else str(request.output)
    checked = read_text(name, text)
    return _Checked(text, examine(checked).diagnostics, checked.program.sources)


# ---------------------------------------------------------------- plans


def _imported_plan(request: ImportRequest, plan: QgcPlan) -> ImportedSource | Refusal:
    to = request.to or (MISSION if plan.items or plan.not_kept else ZONES)
    unused = _unused(request, _OF_AREAS, "areas of KML, GeoJSON and zone formats")
    if unused is None and to == ZONES:
        unused = _unused(request, _OF_MISSIONS, "the mission of a plan")
    if unused is not None:
        return unused
    made = _plan_zones(request, plan) if to == ZONES else _plan_mission(request, plan)
    return _finished(request, "plan", to, made)


def _introduction(request: ImportRequest) -> str:
    return f"// Imported from `{comment(request.file.name)}` (docs/import.md).\n"


def _plan_zones(request: ImportRequest, plan: QgcPlan) -> _Made | Refusal:
    """The zones of its fence."""
    fence = fence_zones(plan, SourceNames())
    not_kept = tuple(each for each in plan.not_kept if each.place.startswith("/geoFence"))
    if not fence.zones and not not_kept:
        return _unread(request, "it has no fence to make zones of", "`--to mission` imports its items")
    lost = tuple(each for each in plan.losses if each.place.startswith("/geoFence"))
    rules = (fence.airspace(),) if fence.airspace() else ()
    told = "".join(f"// For a policy: {rule}\n" for rule in rules)
    text = "\n".join([_introduction(request) + told, *(each.text() for each in fence.zones)])
    return _Made(text, len(fence.zones), 0, lost, not_kept, rules)


def _plan_mission(request: ImportRequest, plan: QgcPlan) -> _Made | Refusal:
    """The mission under the given policy, or under one that is made for it. Surveys are steps of their own, if that
    keeps their meaning and the checker accepts it; otherwise the planner's legs are flown.
    """
    if not plan.items and not plan.not_kept:
        return _unread(request, "it has no mission", "`--to zones` imports its fence")
    names, surveys, why = SourceNames(), list[CoveredSurvey](), dict[str, str]()
    for place, each in plan.surveys.items():
        try:
            surveys.append(_survey(request, plan, each, names))
        except NoSurvey as error:
            why[place] = str(error)
    if surveys:
        made = _mission(request, _with_reasons(covered_plan(plan, surveys), why), names, surveys)
        if isinstance(made, Refusal):
            told = made.text
        else:
            checked = _check(request, made.text)
            errors = [each for each in checked.diagnostics if has_errors([each]) and each.code.id not in _OF_CHARGE]
            if not errors:
                return made._replace(checked=checked)
            told = f"the checker refuses it as a step: {errors[0].message}"
        why |= {each.place: told for each in surveys}
    return _mission(request, _with_reasons(plan, why), SourceNames(), ())


def _survey(request: ImportRequest, plan: QgcPlan, survey: QgcSurvey | str, names: SourceNames) -> CoveredSurvey:
    """A survey as a step. Raises `NoSurvey`."""
    if request.legs:
        raise NoSurvey("as requested by `--legs`")
    if isinstance(survey, str):
        raise NoSurvey(survey)
    if request.policy is not None or plan.home is None:
        raise NoSurvey("the given policy has no skill for it")
    return cover_survey(plan, survey, GeoPoint(*plan.home), names)


def _with_reasons(plan: QgcPlan, why: Mapping[str, str]) -> QgcPlan:
    """A plan that says why the legs of a survey are kept, or why it is not kept."""
    losses = [
        each._replace(what=f"{each.what}: {why[each.place]}")
        if each.name == "survey-parameters" and each.place in why
        else each
        for each in plan.losses
    ]
    not_kept = [
        each._replace(why=f"{each.why}: {why[each.place]}") if why.get(each.place, each.why) != each.why else each
        for each in plan.not_kept
    ]
    return plan._replace(losses=tuple(losses), not_kept=tuple(not_kept))


def _mission(
    request: ImportRequest, plan: QgcPlan, names: SourceNames, surveys: Sequence[CoveredSurvey]
) -> _Made | Refusal:
    """The mission, with these surveys as steps."""
    plan = without_jumps(plan)
    policy = _drafted(request, plan, names, surveys) if request.policy is None else _given(request, plan)
    if isinstance(policy, Refusal):
        return policy
    places = frozenset(each.place for each in plan.not_kept)
    found = plan_steps(plan, policy.table, places, {each.place: each.step for each in surveys})
    not_kept = (*plan.not_kept, *found.not_kept)
    if not found.steps and (not not_kept or not left_out(not_kept, request.skip)[0]):
        return _unread(request, "no item of its mission flies")
    header = policy.header._replace(name=policy.names.of(request.file.stem, "mission"), proposer=request.proposer)
    text = f"{policy.text}\n{mission_text(header, found.steps)}"
    lost = (*plan.losses, *policy.losses, *found.losses, *(loss for each in surveys for loss in each.losses))
    return _Made(text, policy.zones, len(found.steps), lost, not_kept)


class _Policy(NamedTuple):
    """The beginning of a mission's source, what it names, how items are read, the names that are free beside those of
    the policy, and the losses that come with the policy.
    """

    text: str
    header: MissionHeader
    table: StepTable
    names: SourceNames
    losses: tuple[Loss, ...]
    zones: int = 0


def _drafted(
    request: ImportRequest, plan: QgcPlan, names: SourceNames, surveys: Sequence[CoveredSurvey] = ()
) -> _Policy | Refusal:
    if plan.home is None:
        return _unread(request, "it has no planned home", "name the source of a policy with `--policy`")
    home = GeoPoint(*plan.home)
    draft = draft_policy(plan, home, names, surveys)
    text = _introduction(request) + draft.text
    name = request.output or Path(_UNNAMED)
    try:
        missions = Missions([name], {shown(str(name)): text.encode()})
    except NoPolicy as error:
        return _unread(request, f"no policy can be made for it: {error}", "name the source of a policy with `--policy`")
    header = MissionHeader("", draft.name, 1, VEHICLE, "", request.file.name)
    taken = SourceNames(missions.names)
    return _Policy(text, header, _table(missions), taken, draft.losses, text.count("\nzone "))


def _given(request: ImportRequest, plan: QgcPlan) -> _Policy | Refusal:
    assert request.policy is not None
    try:
        missions = Missions([request.policy])
    except NoPolicy as error:
        return Refusal("no-policy", f"`{request.policy}`: {error}", "check it: `rtshcua check`", ExitCode.DIAGNOSTICS)
    folder = Path() if request.output is None else request.output.parent
    path = Path(os.path.relpath(request.policy, folder)).as_posix()
    lowered = missions.lowered
    header = MissionHeader(
        "", lowered.declaration.name.text, lowered.declaration.version, lowered.vehicle.name.text, "", request.file.name
    )
    losses = [Loss("fence", each.place, "an area of the fence") for each in plan.fences]
    table = _table(missions)
    if plan.home is not None and plan.home != table.home:
        losses.append(Loss("planned-home", "/mission/plannedHomePosition", place_text(*plan.home)))
    text = f'import "{path}"\n\n{_introduction(request)}'
    return _Policy(text, header, table, SourceNames(missions.names), tuple(losses))


def _table(missions: Missions) -> StepTable:
    prepared = prepare(missions.policy)
    assert not isinstance(prepared, Refusal), prepared
    projection, elevation = missions.policy.projection, missions.lowered.vehicle.elevation
    return StepTable(
        prepared,
        missions.defaults(),
        accepted_commands(missions.program, dialect.load(), missions.policy),
        (projection.latitude, projection.longitude),
        None if elevation is None else elevation.value,
    )


# ---------------------------------------------------------------- zones


def _imported_json(request: ImportRequest, terms: ZoneTerms, data: bytes) -> ImportedSource | Refusal:
    """The zones of a file of ED-269, or of the features of GeoJSON."""
    try:
        tree = read_json(data)
    except NoArea as error:
        raise NotReadable(error.message, error.help or "") from None
    try:
        if isinstance(tree, dict | list) and is_ed269(tree):
            from rtshcua.ground.exchange.geographical_zones import read_ed269

            return _imported_zones(request, terms, "ed-269", read_ed269(tree), (), ())
        features = features_of(tree)
        found: list[ZoneFeature] = []
        losses: list[Loss] = []
        kind = "geojson"
        for place, each in features:
            if is_ed269_feature(each):
                from rtshcua.ground.exchange.geographical_zones import read_ed269_feature

                kind = "ed-269"
                found += read_ed269_feature(each, place)
            elif is_ed318(each):
                from rtshcua.ground.exchange.geographical_zones import read_ed318

                kind = "ed-318"
                found += read_ed318(each, place)
            elif not is_point(each):
                found.append(read_feature(each, place, terms.width, request.use))
            elif isinstance(point := read_point(each, place), Loss):
                losses.append(point)
            else:
                found.append(point)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in _EXTRA:
            raise
        help = "run `pip install '.[import]'` in the checkout"
        return Refusal("input", f"the package `{error.name}` is required and not installed", help)
    return _imported_zones(request, terms, kind, found, losses, tuple(_of_the_whole(tree)) if kind == "geojson" else ())


def _of_the_whole(tree: Any) -> Iterator[NotKept]:
    """The heights and times that a collection states for all of its features."""
    try:
        refuse_unread({name: value for name, value in tree.items() if name not in ("features", "items")})
    except NoArea as error:
        if tree.get("type") == "FeatureCollection":
            yield NotKept("collection", "/", error.message, error.help or "")


def _imported_zones(
    request: ImportRequest, terms: ZoneTerms, kind: str, features: Sequence[ZoneFeature],
    losses: Sequence[Loss], not_kept: Sequence[NotKept],
) -> ImportedSource | Refusal:  # fmt: skip
    written = write_zones(features, terms, SourceNames())
    if not features and not not_kept:
        return _unread(request, "it has no area")
    told = "".join(f"// For a policy: {rule}\n" for rule in written.rules)
    text = "\n".join([_introduction(request) + told, *(each.text() for each in written.zones)])
    refused = (*not_kept, *written.not_kept)
    if not written.zones and not left_out(refused, request.skip)[0]:
        return _unread(request, "nothing of it is left")
    made = _Made(text, len(written.zones), 0, (*losses, *written.losses), refused, written.rules)
    return _finished(request, kind, ZONES, made)
