"""One policy for one vehicle, with all that it rests on."""

from collections.abc import Iterable

from rtshcua.ground.lower.policy_checks import applies, rule_applies
from rtshcua.ground.report.changes import Changes, changes
from rtshcua.ground.report.model import (
    CaseTold,
    Chapter,
    Fact,
    FileDigest,
    MissionTold,
    ParameterTold,
    PatternTold,
    RuleTold,
    ScenarioTold,
    SignalTold,
    SkillTold,
    Start,
)
from rtshcua.ground.report.permitted_limits import permitted
from rtshcua.ground.report.rights import asked_of, rights, rule_names
from rtshcua.ground.report.subject import Subject
from rtshcua.ground.report.words.places import told_vehicle
from rtshcua.ground.report.words.rules import told_airspace, told_evidence, told_rule, told_silence
from rtshcua.ground.report.words.signals import told_members, told_sources, told_type, told_unknown
from rtshcua.ground.report.words.skills import (
    AS_LINK,
    told_chain,
    told_clause,
    told_left_out,
    told_motion,
    told_parameter,
    told_patterns,
    told_record,
    told_timing,
)
from rtshcua.ground.report.zones import zones
from rtshcua.model.flat.policy import AfterSilence, Policy
from rtshcua.model.ir.skills import Clause, SkillDecl
from rtshcua.wire.bundle import policy_digest, policy_payload


def digest_of(policy: Policy) -> str:
    """What names exactly what is signed: the digest that `compile` gives."""
    return policy_digest(policy_payload(policy)).hex()


def chapter(
    subject: Subject,
    missions: Iterable[MissionTold] = (),
    starts: Iterable[Start] = (),
    cases: Iterable[CaseTold] = (),
    scenarios: Iterable[ScenarioTold] = (),
    old: Policy | None = None,
    since: str = "",
) -> Chapter:
    """The chapter of a policy; `old` is the earlier one that `since` names, if there is one."""
    policy, declaration = subject.policy, subject.lowered.declaration
    changed = Changes() if old is None else changes(old, policy)
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
        vehicle=tuple(Fact(what, value) for what, value in told_vehicle(subject.lowered.vehicle)),
        home=(0, 0),
        home_within=policy.vehicle.home_within,
        return_altitude=policy.vehicle.return_altitude,
        rights=rights(subject),
        rules=tuple(_rule(subject, number, changed) for number in range(len(policy.rules))),
        rules_left_out=tuple(
            told_rule(each, rule_names(subject, each))
            for each in declaration.rules
            if not rule_applies(each, frozenset(policy.vehicle.without))
        ),
        permitted=permitted(subject),
        airspace=told_airspace(declaration.airspace),
        contingency=told_chain(declaration.contingency, subject.names),
        evidence=told_evidence(declaration.without_evidence),
        silence=told_silence(policy.silence_us, AfterSilence(policy.after_silence).name.lower()),
        skills=tuple(
            _skill(subject, subject.symbols.skills[each.name], each.name in changed.skills) for each in policy.contracts
        ),
        signals=tuple(_signal(subject, name, name in changed.signals) for name in signals),
        states=tuple(
            Fact(name, told_members(subject.symbols.enums[name])) for name in types if name in subject.symbols.enums
        ),
        zones=zones(subject, changed.zones),
        missions=tuple(missions),
        starts=tuple(starts),
        cases=tuple(cases),
        scenarios=tuple(scenarios),
        since=since if old is not None else "",
        changes=changed.told,
    )


def _rule(subject: Subject, number: int, changed: Changes) -> RuleTold:
    flat, rule = subject.policy.rules[number], subject.rules[number]
    return RuleTold(
        number=number + 1,
        kind=rule.kind,
        told=told_rule(rule, rule_names(subject, rule)),
        written=flat.text,
        place=subject.place(rule.span),
        changed=number in changed.rules,
    )


def _skill(subject: Subject, skill: SkillDecl, changed: bool) -> SkillTold:
    names = asked_of(subject, [skill])

    without = frozenset(subject.policy.vehicle.without)
    parts = (("require", skill.require), ("assume", skill.assume), ("maintain", skill.maintain))

    def clauses(some: tuple[Clause, ...]) -> tuple[str, ...]:
        return tuple(told_clause(each, names) for each in some if applies(each, without))

    return SkillTold(
        name=skill.name.text,
        note=subject.note(skill),
        motion=told_motion(skill.motion),
        patterns=tuple(PatternTold(*each) for each in told_patterns(skill)),
        parameters=tuple(
            ParameterTold(each.name.text, *told_parameter(each, subject.names)) for each in skill.parameters
        ),
        timing=tuple(told_timing(skill)),
        require=clauses(skill.require),
        assume=clauses(skill.assume),
        maintain=clauses(skill.maintain),
        left_out=tuple(
            told_left_out(part, each, names) for part, some in parts for each in some if not applies(each, without)
        ),
        fallback=told_chain(skill.fallback, names),
        as_link=AS_LINK if skill.name.text in _last_links(subject) else "",
        record=told_record(skill),
        place=subject.place(skill.span),
        changed=changed,
    )


def _last_links(subject: Subject) -> frozenset[str]:
    """The skills that the chains of a policy end in."""
    chains = [subject.policy.contingency, *(contract.fallback for contract in subject.policy.contracts)]
    return frozenset(subject.policy.contracts[chain[-1].skill].name for chain in chains if chain)


def _signal(subject: Subject, name: str, changed: bool) -> SignalTold:
    signal = subject.symbols.signals[name]
    return SignalTold(name, told_type(signal), told_sources(signal), told_unknown(signal), changed)
