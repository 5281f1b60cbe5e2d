"""The chapter of a policy for a vehicle: rules, skills, signals and zones as signed, and missions with their paths."""

from collections.abc import Iterable, Iterator, Mapping

from rtshcua.ground.drawing.drawn_site import PlaceView, ZoneView
from rtshcua.ground.drawing.flat_site import (
    ALLOWED,
    FORBIDDEN,
    OTHER,
    ground_of,
    is_timed,
    limits_of,
    margins_of,
    places,
)
from rtshcua.ground.lower.policy import LoweredPolicy
from rtshcua.ground.lower.policy_checks import applies, rule_applies
from rtshcua.ground.lower.zones import derived_name
from rtshcua.ground.prove.mission_bounds import Bounds, rounded_energy, rounded_time
from rtshcua.ground.prove.survey_quality import StepPictures, pictures_text
from rtshcua.ground.report.permissions import permitted_limits, rights, rule_names, vocabulary_of
from rtshcua.ground.report.policy_changes import PolicyChanges, changes
from rtshcua.ground.report.prose.mission_steps import (
    describe_asker,
    describe_otherwise,
    describe_step,
    describe_tighter,
)
from rtshcua.ground.report.prose.phrases import degrees
from rtshcua.ground.report.prose.rules_and_skills import (
    AS_LINK,
    describe_accepted,
    describe_airspace,
    describe_chain,
    describe_clause,
    describe_emitted,
    describe_evidence,
    describe_left_out,
    describe_members,
    describe_motion,
    describe_parameter,
    describe_patterns,
    describe_pictures,
    describe_record,
    describe_rule,
    describe_silence,
    describe_sources,
    describe_timing,
    describe_type,
    describe_unknown,
)
from rtshcua.ground.report.prose.zones_and_vehicle import (
    describe_band,
    describe_shape,
    describe_times,
    describe_vehicle,
    places_of,
)
from rtshcua.ground.report.report_model import (
    CaseView,
    Chapter,
    Fact,
    FileDigest,
    MissionView,
    NominalView,
    ParameterView,
    PatternView,
    RuleView,
    ScenarioView,
    SignalView,
    SkillView,
    StepView,
)
from rtshcua.ground.report.reported_policy import ReportedPolicy, within
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.policy import AfterSilence, Policy
from rtshcua.model.flat.zone import Zone, project, unproject
from rtshcua.model.ir.expression import Grow, Quantity
from rtshcua.model.ir.places import Combination, GeoJson, Shape, ZoneDecl
from rtshcua.model.ir.skills import ClauseDecl, SkillDecl
from rtshcua.model.quantity import Dimension, display
from rtshcua.wire.bundle import policy_digest, policy_payload


def zones(subject: ReportedPolicy, changed: frozenset[str]) -> tuple[ZoneView, ...]:
    """The declared zones in their order, then those that rules derive."""
    policy = subject.policy
    views = [_declared(subject, zone, changed) for zone in policy.zones[: policy.declared]]
    grown = _grown(subject)
    seen: set[str] = set()
    for zone in policy.zones[policy.declared :]:
        if zone.name in grown and zone.name not in seen:
            seen.add(zone.name)
            views.append(_derived(zone, grown[zone.name]))
    return tuple(views)


def _declared(subject: ReportedPolicy, zone: Zone, changed: frozenset[str]) -> ZoneView:
    declared = subject.symbols.zones[zone.name]
    return ZoneView(
        name=zone.name,
        note=subject.note(declared),
        use=_use(subject, zone.name),
        shape=describe_shape(declared.shape),
        band=describe_band(declared),
        times=describe_times(declared),
        ground=ground_of(zone),
        floor=limits_of(zone)[0],
        ceiling=limits_of(zone)[1],
        places=tuple(_places(subject, declared, zone)),
        place=subject.place(declared.span),
        changed=zone.name in changed,
        timed=is_timed(zone),
    )


def _derived(zone: Zone, grow: Grow) -> ZoneView:
    margin = grow.margin.value if isinstance(grow.margin, Quantity) else 0
    length = display(abs(margin), Dimension.LENGTH)
    way = f"nearer than {length} to" if margin >= 0 else f"further than {length} inside of"
    return ZoneView(
        name=zone.name,
        note="",
        use=OTHER,
        shape=f"all places {way} `{grow.zone.name}`",
        band=f"as `{grow.zone.name}`",
        times=f"as `{grow.zone.name}`",
        ground=ground_of(zone),
        floor=limits_of(zone)[0],
        ceiling=limits_of(zone)[1],
        places=(),
        place="",
        changed=False,
        derived=True,
        timed=is_timed(zone),
    )


def _use(subject: ReportedPolicy, name: str) -> str:
    airspace = subject.lowered.declaration.airspace
    if airspace is None:
        return OTHER
    if name in {each.text for each in airspace.outside}:
        return FORBIDDEN
    return ALLOWED if name in {each.text for each in airspace.inside} else OTHER


def _grown(subject: ReportedPolicy) -> dict[str, Grow]:
    """The zones that rules grow, by their signed names."""
    found = {}
    for rule in subject.rules:
        for node in within(rule.when):
            if isinstance(node, Grow) and isinstance(node.margin, Quantity):
                found[derived_name(node.zone.name, node.margin.value, smaller=False)] = node
    return found


def _places(subject: ReportedPolicy, declared: ZoneDecl, zone: Zone) -> Iterator[PlaceView]:
    """Yield the places in a zone's declaration, its entry, and every corner of an outline from a file."""
    projection = subject.policy.projection
    written = list(places_of(declared.shape))
    if declared.entry is not None:
        written.append(("entry", declared.entry))
    for what, at in written:
        x, y = project(projection, at.latitude, at.longitude)
        yield _place(what, at.latitude, at.longitude, x, y)
    if _from_file(declared.shape):
        for number, ring in enumerate(ground_of(zone).rings, 1):
            for corner, (x, y) in enumerate(ring, 1):
                yield _place(f"ring {number}, corner {corner}", *unproject(projection, x, y), x, y)


def _from_file(shape: Shape) -> bool:
    """Whether a shape, or a part of it, comes from a GeoJSON file."""
    if isinstance(shape, Combination):
        return any(map(_from_file, shape.shapes))
    return isinstance(shape, GeoJson)


def _place(what: str, latitude: int, longitude: int, x: int, y: int) -> PlaceView:
    return PlaceView(what, degrees(latitude, "N", "S"), degrees(longitude, "E", "W"), x, y)


def mission_view(
    mission: Mission,
    policy: Policy,
    bounds: Bounds | None,
    values: Mapping[str, str],
    pictures: Iterable[StepPictures] = (),
) -> MissionView:
    """Describe a mission; `values` are the parameter values for which its path is drawn."""
    shown = {each.step_number: f"Pictures by {pictures_text(each)}." for each in pictures}
    first = mission.invocations[0]
    by = f"Proposed by {mission.proposer or 'a person'}, {describe_asker(first, policy)}."
    drawn = ", ".join(f"`{name}` = {value}" for name, value in values.items())
    return MissionView(
        name=mission.name,
        intent=mission.intent,
        proposed=by,
        bounds=() if bounds is None else tuple(_bounds(bounds)),
        values=drawn,
        steps=tuple(_step(step, mission, policy, shown.get(step.step + 1, "")) for step in mission.invocations),
    )


def _bounds(bounds: Bounds) -> Iterator[Fact]:
    yield Fact("Steps", f"at most {bounds.invocations}")
    yield Fact("Time", f"at most {rounded_time(bounds.time_us)} from issue to end")
    yield Fact("Charge", f"at most {rounded_energy(bounds.energy)} of a full charge, the sum over all its steps")


def _step(step: Invocation, mission: Mission, policy: Policy, pictures: str) -> StepView:
    return StepView(
        number=step.step + 1,
        phase=mission.phases[step.phase],
        told=describe_step(step, policy),
        otherwise=describe_otherwise(step),
        tighter=tuple(describe_tighter(step, policy)),
        path=places(step.plan.path),
        altitude=step.plan.altitude,
        motion=MotionKind(step.plan.kind).name.lower(),
        speed=step.plan.speed,
        heights=step.plan.heights,
        pictures=pictures,
    )


def elevation_of(lowered: LoweredPolicy) -> int | None:
    """The declared elevation of home, mm above mean sea level; None if there is none."""
    declared = lowered.vehicle.elevation
    return None if declared is None else declared.value


def digest_of(policy: Policy) -> str:
    """The digest of the signed policy, the same as from `compile`."""
    return policy_digest(policy_payload(policy)).hex()


def chapter(
    subject: ReportedPolicy,
    missions: Iterable[MissionView] = (),
    starts: Iterable[NominalView] = (),
    cases: Iterable[CaseView] = (),
    scenarios: Iterable[ScenarioView] = (),
    old: Policy | None = None,
    since: str = "",
) -> Chapter:
    """Make the chapter of a policy; `old` is the earlier policy named by `since`, if any."""
    policy, declaration = subject.policy, subject.lowered.declaration
    changed = PolicyChanges() if old is None else changes(old, policy)
    signals = [signal.name for signal in policy.signals]
    types = {subject.symbols.signals[name].type.text: None for name in signals}
    return Chapter(
        name=policy.name,
        version=policy.version,
        place=subject.place(declaration.name.span).rpartition(":")[0],
        note=subject.note(declaration),
        digest=digest_of(policy),
        files=tuple(
            FileDigest(name, digest.hex()) for name, digest in zip(subject.files, policy.source_digests, strict=True)
        ),
        vehicle=tuple(Fact(what, value) for what, value in describe_vehicle(subject.lowered.vehicle)),
        home=(0, 0),
        home_within=policy.vehicle.home_within,
        return_altitude=policy.vehicle.return_altitude,
        elevation=elevation_of(subject.lowered),
        margins=margins_of(policy),
        rights=rights(subject),
        rules=tuple(_rule(subject, number, changed) for number in range(len(policy.rules))),
        rules_left_out=tuple(
            describe_rule(each, rule_names(subject, each))
            for each in declaration.rules
            if not rule_applies(each, frozenset(policy.vehicle.without))
        ),
        permitted=permitted_limits(subject),
        airspace=describe_airspace(declaration.airspace),
        contingency=describe_chain(declaration.contingency, subject.names),
        evidence=describe_evidence(declaration.without_evidence),
        silence=describe_silence(policy.silence_us, AfterSilence(policy.after_silence).name.lower()),
        skills=tuple(
            _skill(subject, subject.symbols.skills[each.name], each.name in changed.skills) for each in policy.contracts
        ),
        signals=tuple(_signal(subject, name, name in changed.signals) for name in signals),
        states=tuple(
            Fact(name, describe_members(subject.symbols.enums[name])) for name in types if name in subject.symbols.enums
        ),
        zones=zones(subject, changed.zones),
        missions=tuple(missions),
        starts=tuple(starts),
        cases=tuple(cases),
        scenarios=tuple(scenarios),
        since=since if old is not None else "",
        changes=changed.told,
    )


def _rule(subject: ReportedPolicy, number: int, changed: PolicyChanges) -> RuleView:
    flat, rule = subject.policy.rules[number], subject.rules[number]
    return RuleView(
        number=number + 1,
        kind=rule.kind,
        told=describe_rule(rule, rule_names(subject, rule)),
        written=flat.text,
        place=subject.place(rule.span),
        changed=number in changed.rules,
    )


def _skill(subject: ReportedPolicy, skill: SkillDecl, changed: bool) -> SkillView:
    names = vocabulary_of(subject, [skill])

    without = frozenset(subject.policy.vehicle.without)
    parts = (("require", skill.require), ("assume", skill.assume), ("maintain", skill.maintain))

    def clauses(some: tuple[ClauseDecl, ...]) -> tuple[str, ...]:
        return tuple(describe_clause(each, names) for each in some if applies(each, without))

    return SkillView(
        name=skill.name.text,
        note=subject.note(skill),
        motion=describe_motion(skill.motion) + describe_pictures(skill.pictures),
        patterns=tuple(PatternView(*each) for each in describe_patterns(skill)),
        parameters=tuple(
            ParameterView(each.name.text, *describe_parameter(each, subject.names)) for each in skill.parameters
        ),
        timing=tuple(describe_timing(skill)),
        require=clauses(skill.require),
        assume=clauses(skill.assume),
        maintain=clauses(skill.maintain),
        left_out=tuple(
            describe_left_out(part, each, names) for part, some in parts for each in some if not applies(each, without)
        ),
        fallback=describe_chain(skill.fallback, names),
        as_link=AS_LINK if skill.name.text in _last_links(subject) else "",
        record=describe_record(skill),
        accepted=tuple(describe_accepted(skill)),
        emitted=tuple(describe_emitted(skill)),
        place=subject.place(skill.span),
        changed=changed,
    )


def _last_links(subject: ReportedPolicy) -> frozenset[str]:
    """The skills at the ends of a policy's chains."""
    chains = [subject.policy.contingency, *(contract.fallback for contract in subject.policy.contracts)]
    return frozenset(subject.policy.contracts[chain[-1].skill].name for chain in chains if chain)


def _signal(subject: ReportedPolicy, name: str, changed: bool) -> SignalView:
    signal = subject.symbols.signals[name]
    return SignalView(name, describe_type(signal), describe_sources(signal), describe_unknown(signal), changed)
