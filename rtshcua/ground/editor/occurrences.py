"""Finds all names in a file, with their targets in a program."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from enum import Enum
from typing import Any, Final, NamedTuple

from msgspec.structs import astuple

from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.checks.scenarios import OBSTACLE
from rtshcua.ground.checker.name_scope import LOCAL_TIME, PHASE
from rtshcua.ground.checker.symbols import Declaration, Symbols
from rtshcua.ground.checker.types import NAMED
from rtshcua.model.ir.expression import Comparison, OneOf, Reference
from rtshcua.model.ir.missions import Item, MissionDecl, Overrides, Step
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.places import ENTRY, VehicleDecl, ZoneDecl
from rtshcua.model.ir.policies import Delegation, PolicyDecl, RoleDecl, RuleDecl, TemplateDecl, Use
from rtshcua.model.ir.program import Import, Unit
from rtshcua.model.ir.scenarios import (
    AfterStepDecl,
    DecidesDecl,
    FaultCall,
    FliesDecl,
    Keeps,
    Lands,
    OnConditionDecl,
    ScenarioDecl,
)
from rtshcua.model.ir.signals import EnumDecl, SignalDecl
from rtshcua.model.ir.skills import AcceptsDecl, ArgumentValue, EmitsDecl, LinkDecl, ParameterDecl, SizesDecl, SkillDecl
from rtshcua.model.ir.tests import (
    Asker,
    Assignment,
    CaseTable,
    Expectation,
    InPhase,
    Named,
    NominalDecl,
    RequestDecl,
    TestDecl,
)


class NameKind(Enum):
    """The kinds of names; the value is a description."""

    DECLARED = "declaration"
    PARAMETER = "parameter"
    MEMBER = "value of an enumeration"
    CHOICE = "choice"
    PHASE = "phase"
    CAMERA = "camera"
    ROLE = "role"
    SOURCE = "source of decisions"
    PROPOSER = "proposer"
    CLASS = "timing class"
    RECORD = "kind of evidence"
    TYPE = "type"
    MESSAGE = "message of the dialect"
    FIELD = "field of the dialect"
    DIALECT_ENUM = "enumeration of the dialect"
    COMMAND = "command of the dialect"
    MODE = "flight mode"
    REASON = "reason"
    FAULT = "fault"
    WORD = "keyword"
    IMPORT = "import"


class NameTarget(NamedTuple):
    """The target of a name. `owner` is the skill, template, mission or enumeration of a parameter or member, the skill
    and parameter of a choice, or the importing file of an import.
    """

    kind: NameKind
    name: str
    owner: str = ""


class Occurrence(NamedTuple):
    """A place that refers to `target`; `declares` means that it declares the name."""

    span: Span
    target: NameTarget
    declares: bool = False


#: the kinds of names in the parameters of faults
_OF_FAULTS = {"message": NameKind.MESSAGE, "role": NameKind.ROLE}
#: the targets of parameter names in a scope; several if a rule is about several skills
Scope = Mapping[str, tuple[NameTarget, ...]]


class _OccurrenceFinder:
    """Finds the names in declarations, conditions, values, arguments, tests and scenarios."""

    def __init__(self, symbols: Symbols) -> None:
        self.symbols = symbols

    def names(self, names: Iterable[Name | None], kind: NameKind) -> Iterator[Occurrence]:
        """The occurrences of names of one kind."""
        for name in names:
            if name is not None:
                yield Occurrence(name.span, NameTarget(kind, name.text))

    def role(self, name: Name, scope: Scope) -> Iterator[Occurrence]:
        """The occurrence of a role, or of a template's parameter for a role."""
        for target in scope.get(name.text, (NameTarget(NameKind.ROLE, name.text),)):
            yield Occurrence(name.span, target)

    def contract(self, node: SkillDecl | Overrides, scope: Scope) -> Iterator[Occurrence]:
        """The names in the clauses, phases and records of a contract."""
        yield from self.names(node.phases, NameKind.PHASE)
        yield from self.names(node.record, NameKind.RECORD)
        yield from self.within((node.require, node.assume, node.maintain), scope)

    def within(self, node: Any, scope: Scope) -> Iterator[Occurrence]:
        """The names in a condition, a value or a shape."""
        if isinstance(node, Reference):
            yield from self.reference(node, scope)
        elif isinstance(node, Comparison):
            yield from self._compared(node.left, node.right, scope)
            yield from self._compared(node.right, node.left, scope)
        elif isinstance(node, OneOf):
            yield from self.within(node.subject, scope)
            for name in node.names:
                yield from self._member(Reference(span=name.span, name=name.text), node.subject, scope)
        elif isinstance(node, Node):
            for value in astuple(node):
                yield from self.within(value, scope)
        elif type(node) is tuple:
            for each in node:
                yield from self.within(each, scope)

    def reference(self, node: Reference, scope: Scope) -> Iterator[Occurrence]:
        """The occurrence of a name that is used as a value."""
        name, (file, start, _) = node.name, node.span
        if name in scope:
            yield from (Occurrence(node.span, target) for target in scope[name])
        elif name in self.symbols.declared:
            yield Occurrence(node.span, NameTarget(NameKind.DECLARED, name))
        elif name in (LOCAL_TIME, PHASE):
            yield Occurrence(node.span, NameTarget(NameKind.WORD, name))
        elif name.endswith(ENTRY):
            zone = name.removesuffix(ENTRY)
            yield Occurrence(Span(file, start + len(zone) + 1, node.span.end), NameTarget(NameKind.WORD, "entry"))
            yield from self.reference(Reference(span=Span(file, start, start + len(zone)), name=zone), scope)
        else:
            yield Occurrence(node.span, NameTarget(NameKind.DECLARED, name))

    def arguments(
        self, written: Sequence[ArgumentValue], owner: SkillDecl | TemplateDecl | None, scope: Scope
    ) -> Iterator[Occurrence]:
        """The names in the arguments of a step, a link or a use."""
        parameters = () if owner is None else owner.parameters
        named = {each.name.text: each for each in parameters}
        for position, each in enumerate(written):
            parameter = parameters[position] if position < len(parameters) else None
            if each.name is not None:
                parameter = named.get(each.name.text)
                if owner is not None:
                    yield Occurrence(each.name.span, NameTarget(NameKind.PARAMETER, each.name.text, owner.name.text))
            yield from self.argument(each.value, parameter, "" if owner is None else owner.name.text, scope)

    def argument(self, value: Node, parameter: ParameterDecl | None, owner: str, scope: Scope) -> Iterator[Occurrence]:
        """The names in an argument, which may be a choice or a role."""
        if isinstance(value, Reference) and parameter is not None and value.name not in scope:
            if any(choice.text == value.name for choice in parameter.choices):
                yield Occurrence(value.span, NameTarget(NameKind.CHOICE, value.name, f"{owner}.{parameter.name.text}"))
                return
            if parameter.type.text == "role":
                yield Occurrence(value.span, NameTarget(NameKind.ROLE, value.name))
                return
        yield from self.within(value, scope)

    def case(self, node: NominalDecl | TestDecl) -> Iterator[Occurrence]:
        """The names in a nominal or a test."""
        scope: dict[str, tuple[NameTarget, ...]] = {}
        if isinstance(node, TestDecl):
            if node.nominal is not None:
                yield Occurrence(node.nominal.span, NameTarget(NameKind.DECLARED, node.nominal.text))
            requested = "" if node.request is None else node.request.skill.text
            skill = self.symbols.skills.get(requested)
            for parameter in () if skill is None else skill.parameters:
                scope[parameter.name.text] = (NameTarget(NameKind.PARAMETER, parameter.name.text, requested),)
        else:
            yield from self.names((node.policy, node.vehicle), NameKind.DECLARED)
        yield from self._case(tuple(value for value in astuple(node) if value is not node.name), scope)

    def scenario(self, node: ScenarioDecl) -> Iterator[Occurrence]:
        """The names in a scenario."""
        yield from self.names((node.mission,), NameKind.DECLARED)
        faults = [each for each in node.start if isinstance(each, FaultCall)]
        for incident in node.incidents:
            match incident.moment:
                case AfterStepDecl(skill=skill):
                    yield from self.names((skill,), NameKind.DECLARED)
                case OnConditionDecl(condition=condition):
                    yield from self.within(condition, {})
            faults.append(incident.fault)
        for fault in faults:
            yield from self._fault(fault)
        for demand in node.demands:
            match demand:
                case DecidesDecl():
                    yield from self._case(demand.decision, {})
                case FliesDecl(skill=name) | Lands(zone=name):
                    yield from self.names((name,), NameKind.DECLARED)
                case Keeps(place=name) if name.text != OBSTACLE:
                    yield from self.names((name,), NameKind.DECLARED)

    def _fault(self, fault: FaultCall) -> Iterator[Occurrence]:
        """The names of a fault and of the messages and roles in its arguments."""
        yield from self.names((fault.name,), NameKind.FAULT)
        for each in fault.arguments:
            kind = None if each.name is None else _OF_FAULTS.get(each.name.text)
            if kind is not None and isinstance(each.value, Reference):
                yield Occurrence(each.value.span, NameTarget(kind, each.value.name))

    def _case(self, node: Any, scope: Scope) -> Iterator[Occurrence]:
        match node:
            case Asker():
                yield from () if node.role is None else self.role(node.role, {})
                yield from self.names((node.source,), NameKind.SOURCE)
            case Assignment(subject=Named(name=name)):
                yield from self.reference(Reference(span=name.span, name=name.text), {})
                if node.cell.value is not None:
                    subject = Reference(span=name.span, name=name.text)
                    yield from self._compared(node.cell.value, subject, {})
            case CaseTable():
                yield from self._table(node, scope)
            case RequestDecl():
                yield from self.names((node.skill,), NameKind.DECLARED)
                yield from self.arguments(node.arguments, self.symbols.skills.get(node.skill.text), {})
                yield from self._case(node.asker, scope)
            case Expectation():
                yield from self.names((node.target,), NameKind.DECLARED)
                yield from self.names((node.reason,), NameKind.REASON)
            case InPhase():
                yield from self.names((node.phase, *node.order), NameKind.PHASE)
            case Node():
                yield from self._premise(node, scope)
            case tuple() if not isinstance(node, Span):
                for each in node:
                    yield from self._case(each, scope)

    def _premise(self, node: Node, scope: Scope) -> Iterator[Occurrence]:
        role, condition = getattr(node, "role", None), getattr(node, "condition", None)
        if isinstance(role, Name):
            yield from self.role(role, {})
        if condition is not None:
            yield from self.within(condition, {})
        else:
            yield from self._case(astuple(node), scope)

    def _table(self, table: CaseTable, scope: Scope) -> Iterator[Occurrence]:
        columns: list[Reference | None] = []
        for column in table.columns:
            if isinstance(column, Named):
                reference = Reference(span=column.name.span, name=column.name.text)
                yield from self.reference(reference, scope)
                columns.append(reference)
            else:
                yield from self.within(column.condition, {})
                columns.append(None)
        for row in table.rows:
            for cell, subject in zip(row.cells, columns, strict=False):
                if cell.value is not None:
                    yield from (
                        self.within(cell.value, {}) if subject is None else self._compared(cell.value, subject, scope)
                    )
            yield from self._case(row.expectation, scope)

    def _compared(self, side: Any, other: Any, scope: Scope) -> Iterator[Occurrence]:
        """The names in one side of a comparison, which may be a member of the other side's type."""
        if isinstance(side, Reference) and side.name not in scope and side.name not in self.symbols.declared:
            yield from self._member(side, other, scope)
        else:
            yield from self.within(side, scope)

    def _member(self, node: Reference, other: Any, scope: Scope) -> Iterator[Occurrence]:
        if isinstance(other, Reference):
            if other.name == PHASE and PHASE not in scope:
                yield Occurrence(node.span, NameTarget(NameKind.PHASE, node.name))
                return
            signal = None if other.name in scope else self.symbols.signals.get(other.name)
            enum = None if signal is None else self.symbols.enums.get(signal.type.text)
            if enum is not None and any(member.name.text == node.name for member in enum.members):
                yield Occurrence(node.span, NameTarget(NameKind.MEMBER, node.name, enum.name.text))
                return
            chosen = tuple(self._choices(node.name, scope.get(other.name, ())))
            if chosen:
                yield from (Occurrence(node.span, target) for target in chosen)
                return
        yield from self.reference(node, scope)

    def _choices(self, name: str, targets: Iterable[NameTarget]) -> Iterator[NameTarget]:
        for target in targets:
            owner = self.symbols.skills.get(target.owner) or self.symbols.missions.get(target.owner)
            for parameter in () if owner is None else owner.parameters:
                if parameter.name.text == target.name and any(each.text == name for each in parameter.choices):
                    yield NameTarget(NameKind.CHOICE, name, f"{target.owner}.{target.name}")

    def declaration(self, node: Node) -> Iterator[Occurrence]:
        """The names in a declaration."""
        name = getattr(node, "name", None)
        if isinstance(name, Name) and not isinstance(node, TestDecl | ScenarioDecl):
            yield Occurrence(name.span, NameTarget(NameKind.DECLARED, name.text), True)
        yield from _FINDERS[type(node)](self, node)

    def _import(self, node: Import) -> Iterator[Occurrence]:
        yield Occurrence(node.span, NameTarget(NameKind.IMPORT, node.path, node.span.file))

    def _zone(self, zone: ZoneDecl) -> Iterator[Occurrence]:
        yield from self.within(zone.shape, {})

    def _vehicle(self, vehicle: VehicleDecl) -> Iterator[Occurrence]:
        yield from self.names(vehicle.without, NameKind.DECLARED)
        for camera in vehicle.cameras:
            yield Occurrence(camera.name.span, NameTarget(NameKind.CAMERA, camera.name.text), True)

    def _roles(self, roles: RoleDecl) -> Iterator[Occurrence]:
        yield from (Occurrence(each.span, NameTarget(NameKind.ROLE, each.text), True) for each in roles.names)

    def _enum(self, enum: EnumDecl) -> Iterator[Occurrence]:
        if enum.dialect is not None:
            yield Occurrence(enum.dialect.span, NameTarget(NameKind.DIALECT_ENUM, enum.dialect.text))
        for member in enum.members:
            yield Occurrence(member.name.span, NameTarget(NameKind.MEMBER, member.name.text, enum.name.text), True)

    def _signal(self, signal: SignalDecl) -> Iterator[Occurrence]:
        enum = None if signal.type.text in NAMED else self.symbols.enums.get(signal.type.text)
        kind = NameKind.TYPE if enum is None else NameKind.DECLARED  # a signal may also be called `position`
        yield Occurrence(signal.type.span, NameTarget(kind, signal.type.text))
        for source in signal.sources:
            yield Occurrence(source.message.span, NameTarget(NameKind.MESSAGE, source.message.text))
            for field in (*source.fields, *(each.field for each in source.where)):
                yield Occurrence(field.span, NameTarget(NameKind.FIELD, field.text, source.message.text))
        for name in signal.unknown_at:
            if enum is not None and any(member.name.text == name.text for member in enum.members):
                yield Occurrence(name.span, NameTarget(NameKind.MEMBER, name.text, enum.name.text))

    def _skill(self, skill: SkillDecl) -> Iterator[Occurrence]:
        owner = skill.name.text
        sizes = self._parameters(skill.sizes, owner)
        scope = sizes | self._parameters(skill.parameters, owner)
        yield from self._declared(skill.parameters, owner, sizes)
        yield from self._declared(skill.sizes, owner)
        named = [each.every for each in skill.emits if isinstance(each.every, Reference)]
        yield from self.within((*(each.size for each in skill.sized), *named), sizes)
        if skill.motion is not None:
            motion = skill.motion
            for name in (
                motion.target, motion.lowest, motion.altitude, motion.every, motion.distance, motion.speed,
                motion.pattern, motion.time,
            ):  # fmt: skip
                if name is not None:
                    yield Occurrence(name.span, NameTarget(NameKind.PARAMETER, name.text, owner))
        yield from self.contract(skill, scope)
        if skill.timing_class is not None:
            yield Occurrence(skill.timing_class.span, NameTarget(NameKind.CLASS, skill.timing_class.text))
        for link in skill.fallback:
            yield from self._link(link, scope)
        yield from self.names([] if skill.pictures is None else [skill.pictures.camera], NameKind.CAMERA)
        for accepts in skill.accepts:
            yield from self._accepts(accepts, owner)
        for emits in skill.emits:
            yield from self._emits(emits, owner, scope)

    def _accepts(self, accepts: AcceptsDecl, owner: str) -> Iterator[Occurrence]:
        """The names of MAVLink, and the parameters that are read from their fields."""
        autopilot = "" if accepts.autopilot is None else accepts.autopilot.text
        kind = {"message": NameKind.MESSAGE, "mode": NameKind.MODE}.get(accepts.kind, NameKind.COMMAND)
        owned_by = autopilot if accepts.kind == "mode" else ""
        yield Occurrence(accepts.name.span, NameTarget(kind, accepts.name.text, owned_by))
        fields = [each.field for each in accepts.where]
        for each in accepts.arguments:
            yield Occurrence(each.parameter.span, NameTarget(NameKind.PARAMETER, each.parameter.text, owner))
            fields += each.fields
        for field in fields:
            yield Occurrence(field.span, NameTarget(NameKind.FIELD, field.text, accepts.name.text))

    def _emits(self, emits: EmitsDecl, owner: str, scope: Scope) -> Iterator[Occurrence]:
        """The command, its parameters, and the parameters of the skill that they are read from."""
        command = emits.command.text
        yield Occurrence(emits.command.span, NameTarget(NameKind.COMMAND, command))
        for each in emits.parameters:
            for field in each.fields:
                yield Occurrence(field.span, NameTarget(NameKind.FIELD, field.text, command))
            if isinstance(each.value, Reference) and each.value.name in scope:
                yield Occurrence(each.value.span, NameTarget(NameKind.PARAMETER, each.value.name, owner))

    def _sizes(self, sizes: SizesDecl) -> Iterator[Occurrence]:
        yield from self.names((sizes.skill,), NameKind.DECLARED)
        for each in sizes.given:
            yield Occurrence(each.name.span, NameTarget(NameKind.PARAMETER, each.name.text, sizes.skill.text))

    def _template(self, template: TemplateDecl) -> Iterator[Occurrence]:
        scope = self._parameters(template.parameters, template.name.text)
        yield from self._declared(template.parameters, template.name.text)
        for rule in template.rules:
            yield from self._rule(rule, scope)

    def _policy(self, policy: PolicyDecl) -> Iterator[Occurrence]:
        for rule in policy.rules:
            yield from self._rule(rule, None)
        for use in policy.uses:
            yield from self._use(use)
        for delegation in policy.delegations:
            yield from self._delegation(delegation)
        if policy.airspace is not None:
            yield from self.names((*policy.airspace.inside, *policy.airspace.outside), NameKind.DECLARED)
        for link in policy.contingency:
            yield from self._link(link, {})

    def _rule(self, rule: RuleDecl, own: Scope | None) -> Iterator[Occurrence]:
        """The names in a rule; `own` are the parameters of its template."""
        yield from self.names(rule.skills, NameKind.DECLARED)
        for role in (*rule.roles, *(each for each in (rule.approver, rule.another) if each is not None)):
            yield from self.role(role, own or {})
        yield from self.names(rule.through, NameKind.SOURCE)
        scope = self._of_skills(rule.skills) | dict(own or {})
        if rule.when is not None:
            yield from self.within(rule.when, scope)
        if rule.target is not None:
            yield from self._link(rule.target, scope)

    def _delegation(self, delegation: Delegation) -> Iterator[Occurrence]:
        yield from self.names(delegation.skills, NameKind.DECLARED)
        yield from self.names((delegation.grantor, delegation.grantee), NameKind.ROLE)
        yield from self.names(delegation.through, NameKind.SOURCE)
        if delegation.when is not None:
            yield from self.within(delegation.when, self._of_skills(delegation.skills))

    def _use(self, use: Use) -> Iterator[Occurrence]:
        yield from self.names((use.template,), NameKind.DECLARED)
        template = self.symbols.templates.get(use.template.text)
        yield from self.arguments(use.arguments, template, {})

    def _link(self, link: LinkDecl, scope: Scope) -> Iterator[Occurrence]:
        yield from self.names((link.skill,), NameKind.DECLARED)
        yield from self.arguments(link.arguments, self.symbols.skills.get(link.skill.text), scope)

    def _mission(self, mission: MissionDecl) -> Iterator[Occurrence]:
        yield from self.names((mission.policy, mission.vehicle), NameKind.DECLARED)
        yield from self.names((mission.source,), NameKind.SOURCE)
        yield from self.names((mission.proposer,), NameKind.PROPOSER)
        yield from self.names((mission.role,), NameKind.ROLE)
        scope = self._parameters(mission.parameters, mission.name.text)
        yield from self._declared(mission.parameters, mission.name.text)
        for phase in mission.phases:
            yield Occurrence(phase.name.span, NameTarget(NameKind.PHASE, phase.name.text), True)
            for item in phase.items:
                yield from self._item(item, scope)

    def _item(self, item: Item, scope: Scope) -> Iterator[Occurrence]:
        if isinstance(item, Step):
            skill = self.symbols.skills.get(item.skill.text)
            yield from self.names((item.skill,), NameKind.DECLARED)
            yield from self.arguments(item.arguments, skill, scope)
            if item.overrides is not None:
                of_skill = {} if skill is None else self._parameters(skill.parameters, skill.name.text)
                yield from self.contract(item.overrides, of_skill | dict(scope))
        else:
            for each in item.items:
                yield from self._item(each, scope)

    def _declared(
        self, parameters: Sequence[ParameterDecl], owner: str, sizes: Scope | None = None
    ) -> Iterator[Occurrence]:
        """The names in parameters, whose ranges and defaults may use the `sizes` of the skill."""
        for parameter in parameters:
            name = parameter.name.text
            yield Occurrence(parameter.name.span, NameTarget(NameKind.PARAMETER, name, owner), True)
            if parameter.choices:
                for choice in parameter.choices:
                    yield Occurrence(choice.span, NameTarget(NameKind.CHOICE, choice.text, f"{owner}.{name}"), True)
            elif parameter.type.span.start < parameter.type.span.end:
                yield Occurrence(parameter.type.span, NameTarget(NameKind.TYPE, parameter.type.text))
            if parameter.range is not None:
                yield from self.within(parameter.range, sizes or {})
            if parameter.default is not None:
                yield from self.argument(parameter.default, parameter, owner, sizes or {})

    def _of_skills(self, names: Iterable[Name]) -> dict[str, tuple[NameTarget, ...]]:
        """The parameters of the skills that a rule names, or of all skills if it names none."""
        written = [name.text for name in names] or list(self.symbols.skills)
        found: dict[str, tuple[NameTarget, ...]] = {}
        for name in written:
            skill = self.symbols.skills.get(name)
            for parameter in () if skill is None else skill.parameters:
                targets = found.get(parameter.name.text, ())
                found[parameter.name.text] = (*targets, NameTarget(NameKind.PARAMETER, parameter.name.text, name))
        return found

    @staticmethod
    def _parameters(parameters: Sequence[ParameterDecl], owner: str) -> dict[str, tuple[NameTarget, ...]]:
        return {each.name.text: (NameTarget(NameKind.PARAMETER, each.name.text, owner),) for each in parameters}


#: finds the names in a declaration, by its type
_FINDERS: Final[Mapping[type, Callable[[_OccurrenceFinder, Any], Iterator[Occurrence]]]] = {
    Import: _OccurrenceFinder._import, EnumDecl: _OccurrenceFinder._enum, SignalDecl: _OccurrenceFinder._signal,
    ZoneDecl: _OccurrenceFinder._zone, VehicleDecl: _OccurrenceFinder._vehicle, SkillDecl: _OccurrenceFinder._skill,
    SizesDecl: _OccurrenceFinder._sizes, TemplateDecl: _OccurrenceFinder._template, RoleDecl: _OccurrenceFinder._roles,
    PolicyDecl: _OccurrenceFinder._policy, MissionDecl: _OccurrenceFinder._mission, TestDecl: _OccurrenceFinder.case,
    NominalDecl: _OccurrenceFinder.case, ScenarioDecl: _OccurrenceFinder.scenario,
}  # fmt: skip


def occurrences(symbols: Symbols, unit: Unit) -> tuple[Occurrence, ...]:
    """Return all occurrences in a file, in source order; a place with several targets has one for each."""
    walk = _OccurrenceFinder(symbols)
    found = [each for declaration in declarations(unit) for each in walk.declaration(declaration)]
    return tuple(sorted(dict.fromkeys(found), key=lambda each: (each.span.start, each.span.end)))


def parameters_owner(symbols: Symbols, name: str) -> SkillDecl | TemplateDecl | MissionDecl | None:
    """The skill, template or mission of this name."""
    return symbols.skills.get(name) or symbols.templates.get(name) or symbols.missions.get(name)


def owned(declared: SkillDecl | TemplateDecl | MissionDecl | None) -> tuple[ParameterDecl, ...]:
    """The parameters of a declaration, and the sizes of a skill."""
    own = () if declared is None else declared.parameters
    return (*own, *declared.sizes) if isinstance(declared, SkillDecl) else own


def declarations(
    unit: Unit,
) -> tuple[Declaration | Import | NominalDecl | TestDecl | ScenarioDecl | RoleDecl | SizesDecl, ...]:
    """All declarations of a file, in source order."""
    every: tuple[Any, ...] = (
        *unit.imports, *unit.enums, *unit.signals, *unit.zones, *unit.vehicles, *unit.skills, *unit.templates,
        *unit.policies, *unit.missions, *unit.nominals, *unit.tests, *unit.scenarios, *unit.roles,
        *unit.sizes,
    )  # fmt: skip
    return tuple(sorted(every, key=lambda each: each.span.start))


def at(found: Sequence[Occurrence], offset: int) -> tuple[Occurrence, ...]:
    """The occurrences at an offset or ending there; of an entry and its zone the smaller one."""
    near = [each for each in found if each.span.start <= offset <= each.span.end]
    inside = [each for each in near if offset < each.span.end] or near
    if not inside:
        return ()
    least = min(each.span.end - each.span.start for each in inside)
    return tuple(each for each in inside if each.span.end - each.span.start == least)


def spans(found: Iterable[Occurrence], targets: Iterable[NameTarget]) -> Mapping[Span, bool]:
    """The places that refer to one of `targets`, and whether they declare it."""
    wanted = set(targets)
    places: dict[Span, bool] = {}
    for each in found:
        if each.target in wanted:
            places[each.span] = places.get(each.span, False) or each.declares
    return places
