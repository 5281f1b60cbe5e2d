"""Every place of a file that means something by name, with what it means in a program."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.symbols import Declaration, Symbols
from rtshcua.ground.checker.types import NAMED
from rtshcua.ground.editor.conditions import Conditions, Scope
from rtshcua.ground.editor.targets import Occurrence, Sort, Target
from rtshcua.model.ir.missions import Item, MissionDecl, Step
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.places import VehicleDecl, ZoneDecl
from rtshcua.model.ir.policies import Delegation, PolicyDecl, RoleDecl, Rule, TemplateDecl, Use
from rtshcua.model.ir.program import Import, Unit
from rtshcua.model.ir.scenarios import ScenarioDecl
from rtshcua.model.ir.signals import EnumDecl, SignalDecl
from rtshcua.model.ir.skills import LinkDecl, Parameter, SizesDecl, SkillDecl
from rtshcua.model.ir.tests import NominalDecl, TestDecl


def occurrences(symbols: Symbols, unit: Unit) -> tuple[Occurrence, ...]:
    """All places of a file, in the order of the text; a place that means several things is there for each."""
    walk = _Walk(symbols)
    found = [each for declaration in declarations(unit) for each in walk.declaration(declaration)]
    return tuple(sorted(dict.fromkeys(found), key=lambda each: (each.span.start, each.span.end)))


def declarations(
    unit: Unit,
) -> tuple[Declaration | Import | NominalDecl | TestDecl | ScenarioDecl | RoleDecl | SizesDecl, ...]:
    """All declarations of a file, in the order of the text."""
    every: tuple[Any, ...] = (
        *unit.imports, *unit.enums, *unit.signals, *unit.zones, *unit.vehicles, *unit.skills, *unit.templates,
        *unit.policies, *unit.missions, *unit.nominals, *unit.tests, *unit.scenarios, *unit.roles,
        *unit.sizes,
    )  # fmt: skip
    return tuple(sorted(every, key=lambda each: each.span.start))


class _Walk(Conditions):
    """One file's places."""

    def declaration(self, node: Node) -> Iterator[Occurrence]:
        """What a declaration says."""
        if isinstance(node, Import):
            yield Occurrence(node.span, Target(Sort.IMPORT, node.path, node.span.file))
            return
        name = getattr(node, "name", None)
        if isinstance(name, Name) and not isinstance(node, TestDecl | ScenarioDecl):
            yield Occurrence(name.span, Target(Sort.DECLARED, name.text), True)
        match node:
            case EnumDecl():
                yield from self._enum(node)
            case SignalDecl():
                yield from self._signal(node)
            case ZoneDecl():
                yield from self.within(node.shape, {})
            case SkillDecl():
                yield from self._skill(node)
            case SizesDecl():
                yield from self._sizes(node)
            case TemplateDecl():
                yield from self._template(node)
            case PolicyDecl():
                yield from self._policy(node)
            case RoleDecl():
                yield from (Occurrence(each.span, Target(Sort.ROLE, each.text), True) for each in node.names)
            case MissionDecl():
                yield from self._mission(node)
            case NominalDecl() | TestDecl():
                yield from self.case(node)
            case ScenarioDecl():
                yield from self.scenario(node)
            case VehicleDecl():
                yield from self.names(node.without, Sort.DECLARED)

    def _enum(self, enum: EnumDecl) -> Iterator[Occurrence]:
        if enum.dialect is not None:
            yield Occurrence(enum.dialect.span, Target(Sort.DIALECT_ENUM, enum.dialect.text))
        for member in enum.members:
            yield Occurrence(member.name.span, Target(Sort.MEMBER, member.name.text, enum.name.text), True)

    def _signal(self, signal: SignalDecl) -> Iterator[Occurrence]:
        enum = None if signal.type.text in NAMED else self.symbols.enums.get(signal.type.text)
        sort = Sort.TYPE if enum is None else Sort.DECLARED  # `signal position : position`: no name of a signal
        yield Occurrence(signal.type.span, Target(sort, signal.type.text))
        for source in signal.sources:
            yield Occurrence(source.message.span, Target(Sort.MESSAGE, source.message.text))
            for field in (*source.fields, *(each.field for each in source.where)):
                yield Occurrence(field.span, Target(Sort.FIELD, field.text, source.message.text))
        for name in signal.unknown_at:
            if enum is not None and any(member.name.text == name.text for member in enum.members):
                yield Occurrence(name.span, Target(Sort.MEMBER, name.text, enum.name.text))

    def _skill(self, skill: SkillDecl) -> Iterator[Occurrence]:
        owner = skill.name.text
        sizes = self._parameters(skill.sizes, owner)
        scope = sizes | self._parameters(skill.parameters, owner)
        yield from self._declared(skill.parameters, owner, sizes)
        yield from self._declared(skill.sizes, owner)
        yield from self.within(tuple(each.size for each in skill.sized), sizes)
        if skill.motion is not None:
            motion = skill.motion
            for name in (motion.target, motion.altitude, motion.speed, motion.pattern, motion.time):
                if name is not None:
                    yield Occurrence(name.span, Target(Sort.PARAMETER, name.text, owner))
        yield from self.contract(skill, scope)
        if skill.timing_class is not None:
            yield Occurrence(skill.timing_class.span, Target(Sort.CLASS, skill.timing_class.text))
        for link in skill.fallback:
            yield from self._link(link, scope)

    def _sizes(self, sizes: SizesDecl) -> Iterator[Occurrence]:
        yield from self.names((sizes.skill,), Sort.DECLARED)
        for each in sizes.given:
            yield Occurrence(each.name.span, Target(Sort.PARAMETER, each.name.text, sizes.skill.text))

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
            yield from self.names((*policy.airspace.inside, *policy.airspace.outside), Sort.DECLARED)
        for link in policy.contingency:
            yield from self._link(link, {})

    def _rule(self, rule: Rule, own: Scope | None) -> Iterator[Occurrence]:
        """A rule; `own` are the parameters of the template that it stands in."""
        yield from self.names(rule.skills, Sort.DECLARED)
        for role in (*rule.roles, *(each for each in (rule.approver, rule.another) if each is not None)):
            yield from self.role(role, own or {})
        yield from self.names(rule.through, Sort.SOURCE)
        scope = self._of_skills(rule.skills) | dict(own or {})
        if rule.when is not None:
            yield from self.within(rule.when, scope)
        if rule.target is not None:
            yield from self._link(rule.target, scope)

    def _delegation(self, delegation: Delegation) -> Iterator[Occurrence]:
        yield from self.names(delegation.skills, Sort.DECLARED)
        yield from self.names((delegation.grantor, delegation.grantee), Sort.ROLE)
        yield from self.names(delegation.through, Sort.SOURCE)
        if delegation.when is not None:
            yield from self.within(delegation.when, self._of_skills(delegation.skills))

    def _use(self, use: Use) -> Iterator[Occurrence]:
        yield from self.names((use.template,), Sort.DECLARED)
        template = self.symbols.templates.get(use.template.text)
        yield from self.arguments(use.arguments, template, {})

    def _link(self, link: LinkDecl, scope: Scope) -> Iterator[Occurrence]:
        yield from self.names((link.skill,), Sort.DECLARED)
        yield from self.arguments(link.arguments, self.symbols.skills.get(link.skill.text), scope)

    def _mission(self, mission: MissionDecl) -> Iterator[Occurrence]:
        yield from self.names((mission.policy, mission.vehicle), Sort.DECLARED)
        for name, sort in ((mission.source, Sort.SOURCE), (mission.proposer, Sort.PROPOSER), (mission.role, Sort.ROLE)):
            if name is not None:
                yield Occurrence(name.span, Target(sort, name.text))
        scope = self._parameters(mission.parameters, mission.name.text)
        yield from self._declared(mission.parameters, mission.name.text)
        for phase in mission.phases:
            yield Occurrence(phase.name.span, Target(Sort.PHASE, phase.name.text), True)
            for item in phase.items:
                yield from self._item(item, scope)

    def _item(self, item: Item, scope: Scope) -> Iterator[Occurrence]:
        if isinstance(item, Step):
            skill = self.symbols.skills.get(item.skill.text)
            yield from self.names((item.skill,), Sort.DECLARED)
            yield from self.arguments(item.arguments, skill, scope)
            if item.overrides is not None:
                of_skill = {} if skill is None else self._parameters(skill.parameters, skill.name.text)
                yield from self.contract(item.overrides, of_skill | dict(scope))
        else:
            for each in item.items:
                yield from self._item(each, scope)

    def _declared(
        self, parameters: Sequence[Parameter], owner: str, sizes: Scope | None = None
    ) -> Iterator[Occurrence]:
        """Parameters; the `sizes` of their skill may be the ends of their ranges, and their defaults."""
        for parameter in parameters:
            name = parameter.name.text
            yield Occurrence(parameter.name.span, Target(Sort.PARAMETER, name, owner), True)
            if parameter.choices:
                for choice in parameter.choices:
                    yield Occurrence(choice.span, Target(Sort.CHOICE, choice.text, f"{owner}.{name}"), True)
            elif parameter.type.span.start < parameter.type.span.end:
                yield Occurrence(parameter.type.span, Target(Sort.TYPE, parameter.type.text))
            if parameter.range is not None:
                yield from self.within(parameter.range, sizes or {})
            if parameter.default is not None:
                yield from self.argument(parameter.default, parameter, owner, sizes or {})

    def _of_skills(self, names: Iterable[Name]) -> dict[str, tuple[Target, ...]]:
        """The parameters of the skills that a rule names; of all skills where it names none."""
        written = [name.text for name in names] or list(self.symbols.skills)
        found: dict[str, tuple[Target, ...]] = {}
        for name in written:
            skill = self.symbols.skills.get(name)
            for parameter in () if skill is None else skill.parameters:
                targets = found.get(parameter.name.text, ())
                found[parameter.name.text] = (*targets, Target(Sort.PARAMETER, parameter.name.text, name))
        return found

    @staticmethod
    def _parameters(parameters: Sequence[Parameter], owner: str) -> dict[str, tuple[Target, ...]]:
        return {each.name.text: (Target(Sort.PARAMETER, each.name.text, owner),) for each in parameters}


def at(found: Sequence[Occurrence], offset: int) -> tuple[Occurrence, ...]:
    """The places that hold a character, or end there; of an entry and its zone the narrower."""
    near = [each for each in found if each.span.start <= offset <= each.span.end]
    inside = [each for each in near if offset < each.span.end] or near
    if not inside:
        return ()
    least = min(each.span.end - each.span.start for each in inside)
    return tuple(each for each in inside if each.span.end - each.span.start == least)


def spans(found: Iterable[Occurrence], targets: Iterable[Target]) -> Mapping[Span, bool]:
    """The places that mean one of `targets`, and whether they give the name."""
    wanted = set(targets)
    places: dict[Span, bool] = {}
    for each in found:
        if each.target in wanted:
            places[each.span] = places.get(each.span, False) or each.declares
    return places
