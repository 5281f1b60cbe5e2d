"""Lower a policy and all its imports to the flat form, for one vehicle.

The flat policy contains every skill that its rules and chains name (for `permit any`, every skill that its files
declare), every signal that these read, and every zone that its files declare, since a mission may use any zone as an
argument.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from msgspec.structs import replace

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.conditions import references
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.name_scope import Scope, signal_type
from rtshcua.ground.checker.symbols import brought_about
from rtshcua.ground.checker.types import Type
from rtshcua.ground.checker.well_known import MEASURED, PER_CELL, VELOCITY, WELL_KNOWN, read_by_all
from rtshcua.ground.geometry.projection import projection_at
from rtshcua.ground.lower.conditions import ConditionLowering, ConditionPlace
from rtshcua.ground.lower.contracts import ContractLowering, cells_of
from rtshcua.ground.lower.policy_checks import check_fitted, fits_on_board, is_self_contained, rule_applies
from rtshcua.ground.lower.tables import SignalSlots, SourceTable, shortened
from rtshcua.ground.lower.vehicle import lower_vehicle
from rtshcua.ground.lower.zones import ZoneTable
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.policy import (
    SILENCE_US,
    AfterSilence,
    Airspace,
    LeftOut,
    Policy,
    Rule,
    RuleKind,
    WithoutEvidence,
)
from rtshcua.model.flat.signal import CELL
from rtshcua.model.ir.expression import Condition, Junction
from rtshcua.model.ir.node import Node
from rtshcua.model.ir.places import GeoJson, VehicleDecl, ZoneDecl
from rtshcua.model.ir.policies import Delegation, PolicyDecl
from rtshcua.model.ir.policies import RuleDecl as RuleDecl
from rtshcua.model.ir.skills import LinkDecl, SkillDecl

#: the role of the person who flies the vehicle; it exists even if no rule names it
OPERATOR = "operator"


@dataclass(frozen=True, slots=True)
class LoweredPolicy:
    """A flat policy, with the indexes, tables and files that the lowering and the proofs of its missions need."""

    policy: Policy
    declaration: PolicyDecl
    vehicle: VehicleDecl
    skills: Mapping[str, int]
    roles: Mapping[str, int]
    contracts: ContractLowering
    conditions: ConditionLowering
    files: SourceTable
    written: Mapping[Rule, RuleDecl]  # each flat rule's declaration
    rules: tuple[RuleDecl, ...]  # the declarations by the number of the flat rule

    @property
    def zones(self) -> ZoneTable:
        """The zones, with their regions."""
        return self.conditions.zones


def lower_policy(
    context: CheckContext, policy: PolicyDecl, vehicle: VehicleDecl, files: frozenset[str], names: Mapping[str, str]
) -> LoweredPolicy | None:
    """Lower a policy with its import closure `files`; `names` are the signed names of files. None after a finding."""
    before = len(context.report.found)
    skills = _skills(context, policy, files)
    read = read_by_all(vehicle)
    if not _well_known(context, policy, read, files) or not is_self_contained(context, policy, skills, vehicle, files):
        return None
    zones = [zone for zone in context.symbols.zones.values() if zone.span.file in files]
    check_fitted(context, policy, vehicle, skills, zones)
    sources = SourceTable(context.report, names)
    _index_sources(context, sources, [policy, vehicle, *zones, *map(context.symbols.signals.__getitem__, read)], skills)
    slots = SignalSlots(context, 1 if vehicle.cells is None else vehicle.cells.value)
    flat_vehicle = lower_vehicle(vehicle, *map(slots.of, read))
    projection = projection_at(vehicle.home.latitude, vehicle.home.longitude)
    zone_table = ZoneTable(projection, zones, context.report, vehicle, context.data)
    conditions = ConditionLowering(context, slots, zone_table, sources)
    numbers = {skill.name.text: number for number, skill in enumerate(skills)}
    contracts = ContractLowering(context, numbers, conditions, flat_vehicle)
    roles = {role: number for number, role in enumerate(_roles(policy))}
    flat_contracts = tuple(contracts.contract(skill) for skill in skills)
    rules = RuleLowering(context, roles, contracts).lowered(policy)
    contingency = contracts.chain(policy.contingency)
    airspace = _airspace(policy, conditions.zones, sources)
    _read_measured(context, vehicle, conditions, files)
    if len(context.report.found) > before:
        return None
    silence = policy.without_link
    flat = Policy(
        name=policy.name.text,
        version=policy.version,
        vehicle=flat_vehicle,
        projection=projection,
        roles=tuple(roles),
        signals=tuple(slots.signals),
        slots=slots.count,
        zones=conditions.zones.flat(),
        declared=len(zones),
        tables=tuple(conditions.zones.tables),
        sets=conditions.sets.all,
        contracts=flat_contracts,
        rules=tuple(rule for rule, _ in rules),
        airspace=airspace,
        contingency=contingency,
        sources=sources.names,
        source_digests=sources.digests,
        monitors=tuple(conditions.monitors.all),
        phases=conditions.sets.phases,
        without_evidence=int(WithoutEvidence[policy.without_evidence.upper()]),
        silence_us=SILENCE_US if silence is None else silence.limit.value,
        left_out=tuple(contracts.left_out),
        after_silence=int(AfterSilence.CONTINGENCY if silence is None else AfterSilence[silence.then.upper()]),
    )
    if not fits_on_board(context, policy, flat):
        return None
    written = tuple(rule for _, rule in rules)
    return LoweredPolicy(
        flat, policy, vehicle, contracts.numbers, roles, contracts, conditions, sources, dict(rules), written
    )


def _index_sources(
    context: CheckContext, sources: SourceTable, parts: Iterable[Node], skills: Sequence[SkillDecl]
) -> None:
    """Add all files on which the policy depends to `sources`, quoted or not."""
    sizes = [context.symbols.sizes[each.name.text] for each in skills if each.name.text in context.symbols.sizes]
    parts = (*parts, *skills, *sizes)
    for part in parts:
        sources.index(part.span.file)
    for zone in parts:
        if isinstance(zone, ZoneDecl) and isinstance(zone.shape, GeoJson):
            data = context.data.name(zone.shape)
            if data is not None:
                sources.index(data)


def _read_measured(
    context: CheckContext, vehicle: VehicleDecl, conditions: ConditionLowering, files: frozenset[str]
) -> None:
    """Give slots to the declared signals that supervision monitors, after all others, whose slots do not change."""
    if vehicle.cells is None and any(each.name == CELL for each in conditions.slots.signals):
        context.report.add(
            codes.WELL_KNOWN_SIGNAL,
            vehicle.name.span,
            f"a condition reads `{CELL}`, but `{vehicle.name.text}` does not declare the number of its battery cells",
            help="declare it in the vehicle, as in `cells 4`, or write `without battery.cell` if nothing measures it",
        )
    for name in sorted(MEASURED.keys() - {name.text for name in vehicle.without}):
        if _is_declared(context, name, files):
            conditions.files.index(context.symbols.signals[name].span.file)
            conditions.slots.of(name)


def _skills(context: CheckContext, policy: PolicyDecl, files: frozenset[str]) -> list[SkillDecl]:
    """Return the skills of a policy, sorted by name."""
    table = context.symbols.skills
    links: list[LinkDecl] = [*policy.contingency, *(rule.target for rule in policy.rules if rule.target is not None)]
    waiting = [name.text for rule in policy.rules for name in rule.skills] + [link.skill.text for link in links]
    if any(rule.kind == "permit" and not rule.skills for rule in policy.rules):
        waiting += [name for name, skill in table.items() if skill.span.file in files]
    found: dict[str, SkillDecl] = {}
    while waiting:
        name = waiting.pop()
        if name not in found:
            found[name] = table[name]
            waiting += [link.skill.text for link in table[name].fallback]
    return [found[name] for name in sorted(found)]


def _roles(policy: PolicyDecl) -> tuple[str, ...]:
    """Return the roles of a policy, sorted: those that its rules name, and the operator."""
    named = {OPERATOR, *(role.text for rule in policy.rules for role in rule.roles)}
    approvers = {name.text for rule in policy.rules for name in (rule.approver, rule.another) if name is not None}
    return tuple(sorted(named | approvers))


def _well_known(context: CheckContext, policy: PolicyDecl, read: Mapping[str, Type], files: frozenset[str]) -> bool:
    """Whether the signals that every decision or the supervision reads are declared. Reports each that is not."""
    good = True
    declared = {name: type for name, type in {**MEASURED, **PER_CELL}.items() if _is_declared(context, name, files)}
    for name, type in (*read.items(), *declared.items()):
        needs = "every flight needs it" if name in WELL_KNOWN else "supervision of a vehicle that `brakes` needs it"
        signal = context.symbols.signals.get(name)
        if signal is None or signal.span.file not in files:
            good = False
            context.report.add(
                codes.WELL_KNOWN_SIGNAL,
                policy.name.span,
                f"the policy `{policy.name.text}` neither declares nor imports a signal `{name}`",
                help=f"{needs}: declare it as {type.describe()}, or import `lib:skills/signals.rts`",
            )
        elif signal_type(context.symbols, signal) != type:
            good = False
            context.report.add(
                codes.WELL_KNOWN_SIGNAL,
                signal.type.span,
                f"the signal `{name}` must be {type.describe()}, because "
                + ("every decision" if name not in VELOCITY else "supervision of braking")
                + " reads it",
                help="rename the signal, or read it from a field of that type",
            )
    return good


def _is_declared(context: CheckContext, name: str, files: frozenset[str]) -> bool:
    signal = context.symbols.signals.get(name)
    return signal is not None and signal.span.file in files


def _airspace(policy: PolicyDecl, zones: ZoneTable, files: SourceTable) -> Airspace | None:
    airspace = policy.airspace
    if airspace is None:
        return None
    text, source, start, end = files.place(airspace.span)
    return Airspace(
        inside=tuple(sorted(zones.zone(name.text, 0, smaller=True, span=name.span) for name in airspace.inside)),
        outside=tuple(sorted(zones.zone(name.text, 0, smaller=False, span=name.span) for name in airspace.outside)),
        text=text,
        source=source,
        start=start,
        end=end,
    )


class RuleLowering:
    """Lowers the rules of one policy. `roles` are the indexes of its roles."""

    def __init__(self, context: CheckContext, roles: Mapping[str, int], contracts: ContractLowering) -> None:
        self._context = context
        self._roles = roles
        self._contracts = contracts
        self._conditions = contracts.conditions
        self._files = contracts.conditions.files
        self._without = frozenset(contracts.vehicle.without)

    def lowered(self, policy: PolicyDecl) -> tuple[tuple[Rule, RuleDecl], ...]:
        """Return the flat rules in source order, with their declarations.

        A rule becomes several flat rules if its skills have an argument in different cells, and none if it does not
        apply to the vehicle.
        """
        found: list[tuple[Rule, RuleDecl]] = []
        for rule in policy.rules:
            if not rule_applies(rule, self._without):
                self._contracts.left_out.append(LeftOut(-1, rule.kind, *self._files.place(rule.span)))
                continue
            with self._context.report.within(brought_about(rule)):
                found += [(flat, rule) for flat in self._rule(rule)]
        return tuple(found)

    def _rule(self, rule: RuleDecl) -> Iterable[Rule]:
        if not rule.skills:
            yield self._flat(rule, ())
            return
        groups: dict[tuple[tuple[str, int], ...], list[SkillDecl]] = {}
        read = set() if rule.when is None else {reference.name for reference in references(rule.when)}
        for name in rule.skills:
            skill = self._context.symbols.skills[name.text]
            layout = tuple(sorted((each, cell) for each, cell in cells_of(skill).items() if each in read))
            groups.setdefault(layout, []).append(skill)
        for skills in groups.values():
            yield self._flat(rule, skills)

    def _flat(self, rule: RuleDecl, skills: Iterable[SkillDecl]) -> Rule:
        skills = tuple(skills)
        kind = RuleKind[rule.kind.upper()]
        arguments = self._context.arguments(skills[0]) if skills else {}
        cells = cells_of(skills[0]) if skills else {}
        place = ConditionPlace(
            Scope(self._context.symbols, self._context.report, arguments), cells, strict=kind is RuleKind.PERMIT
        )
        _, source, start, end = self._files.place(rule.span)
        return Rule(
            kind=int(kind),
            skills=tuple(sorted({self._contracts.numbers[skill.name.text] for skill in skills})),
            roles=tuple(sorted({self._roles[role.text] for role in rule.roles})),
            sources=_sources(rule, kind),
            when=None if rule.when is None else self._when(rule.when, rule, place),
            approver=-1 if rule.approver is None else self._roles[rule.approver.text],
            within_us=0 if rule.within is None else rule.within.value,
            target=None if rule.target is None else self._contracts.link(rule.target),
            text=shortened(": ".join(self._quoted(node) for node in (*rule.origin, rule))),
            source=source,
            start=start,
            end=end,
            second=-1 if rule.another is None else self._roles[rule.another.text],
        )

    def _when(self, when: Condition, rule: RuleDecl, place: ConditionPlace) -> Clause:
        """Lower the condition of a rule. A delegated rule is quoted with the conditions of its delegations."""
        clause = self._conditions.clause(when, place)
        if not any(isinstance(node, Delegation) for node in rule.origin) or not isinstance(when, Junction):
            return clause
        texts = (
            f"({text})" if _is_choice(part) else text for part in _delegated(when) for text in [self._quoted(part)]
        )
        return replace(clause, text=shortened(" and ".join(texts)))

    def _quoted(self, node: Node) -> str:
        return self._context.report.text(node.span)


def _is_choice(condition: Condition) -> bool:
    return isinstance(condition, Junction) and condition.operator == "or"


def _delegated(when: Condition) -> Iterator[Condition]:
    """Yield the conditions of a permit and its delegations, in the order in which they were joined."""
    if isinstance(when, Junction) and when.span == when.operands[-1].span:  # joined by a delegation, not written
        yield from _delegated(when.operands[0])
        yield when.operands[-1]
    else:
        yield when


def _sources(rule: RuleDecl, kind: RuleKind) -> tuple[int, ...]:
    """Return the sources to which a rule applies.

    Without `through`, a permit to a role applies to an operator, and any other rule to all sources.
    """
    if rule.through:
        return tuple(sorted({int(SourceKind[name.text.upper()]) for name in rule.through}))
    if kind is RuleKind.PERMIT and rule.roles:
        return (int(SourceKind.OPERATOR),)
    return ()
