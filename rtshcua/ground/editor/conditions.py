"""The names in conditions, values, arguments, tests and scenarios, with what they mean where they stand."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.checks.scenarios import OBSTACLE
from rtshcua.ground.checker.scope import LOCAL_TIME, PHASE
from rtshcua.ground.checker.symbols import Symbols
from rtshcua.ground.editor.moved import parts
from rtshcua.ground.editor.targets import Occurrence, Sort, Target
from rtshcua.model.ir.expression import Comparison, OneOf, Reference
from rtshcua.model.ir.missions import Overrides
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.places import ENTRY
from rtshcua.model.ir.policies import TemplateDecl
from rtshcua.model.ir.scenarios import AfterStep, Decides, FaultCall, Flies, Keeps, Lands, OnCondition, ScenarioDecl
from rtshcua.model.ir.skills import ArgumentValue, Parameter, SkillDecl
from rtshcua.model.ir.tests import Asker, Assignment, Expectation, InPhase, Named, NominalDecl, Request, Table, TestDecl

#: what the values of a fault's parameters name
_OF_FAULTS = {"message": Sort.MESSAGE, "role": Sort.ROLE}
#: what the names of parameters mean at a place; several where a rule is about several skills
Scope = Mapping[str, tuple[Target, ...]]


class Conditions:
    """What stands within declarations."""

    def __init__(self, symbols: Symbols) -> None:
        self.symbols = symbols

    def names(self, names: Iterable[Name], sort: Sort) -> Iterator[Occurrence]:
        """Names of one sort."""
        for name in names:
            yield Occurrence(name.span, Target(sort, name.text))

    def role(self, name: Name, scope: Scope) -> Iterator[Occurrence]:
        """A role, or a template's parameter for one."""
        for target in scope.get(name.text, (Target(Sort.ROLE, name.text),)):
            yield Occurrence(name.span, target)

    def contract(self, node: SkillDecl | Overrides, scope: Scope) -> Iterator[Occurrence]:
        """The clauses, phases and records of a contract."""
        yield from self.names(node.phases, Sort.PHASE)
        yield from self.names(node.record, Sort.RECORD)
        yield from self.within((node.require, node.assume, node.maintain), scope)

    def within(self, node: Any, scope: Scope) -> Iterator[Occurrence]:
        """All references below a condition, a value or a shape."""
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
            for value in parts(node):
                yield from self.within(value, scope)
        elif type(node) is tuple and not isinstance(node, Span):
            for each in node:
                yield from self.within(each, scope)

    def reference(self, node: Reference, scope: Scope) -> Iterator[Occurrence]:
        """A name that stands for a value."""
        name, (file, start, _) = node.name, node.span
        if name in scope:
            yield from (Occurrence(node.span, target) for target in scope[name])
        elif name in self.symbols.declared:
            yield Occurrence(node.span, Target(Sort.DECLARED, name))
        elif name in (LOCAL_TIME, PHASE):
            yield Occurrence(node.span, Target(Sort.WORD, name))
        elif name.endswith(ENTRY):
            zone = name.removesuffix(ENTRY)
            yield Occurrence(Span(file, start + len(zone) + 1, node.span.end), Target(Sort.WORD, "entry"))
            yield from self.reference(Reference(span=Span(file, start, start + len(zone)), name=zone), scope)
        else:
            yield Occurrence(node.span, Target(Sort.DECLARED, name))

    def arguments(
        self, written: Sequence[ArgumentValue], owner: SkillDecl | TemplateDecl | None, scope: Scope
    ) -> Iterator[Occurrence]:
        """The arguments of a step, a link or a use."""
        parameters = () if owner is None else owner.parameters
        named = {each.name.text: each for each in parameters}
        for position, each in enumerate(written):
            parameter = parameters[position] if position < len(parameters) else None
            if each.name is not None:
                parameter = named.get(each.name.text)
                if owner is not None:
                    yield Occurrence(each.name.span, Target(Sort.PARAMETER, each.name.text, owner.name.text))
            yield from self.argument(each.value, parameter, "" if owner is None else owner.name.text, scope)

    def argument(self, value: Node, parameter: Parameter | None, owner: str, scope: Scope) -> Iterator[Occurrence]:
        """A value for a parameter, which may be a choice or a role."""
        if isinstance(value, Reference) and parameter is not None and value.name not in scope:
            if any(choice.text == value.name for choice in parameter.choices):
                yield Occurrence(value.span, Target(Sort.CHOICE, value.name, f"{owner}.{parameter.name.text}"))
                return
            if parameter.type.text == "role":
                yield Occurrence(value.span, Target(Sort.ROLE, value.name))
                return
        yield from self.within(value, scope)

    def case(self, node: NominalDecl | TestDecl) -> Iterator[Occurrence]:
        """A nominal or a test."""
        scope: dict[str, tuple[Target, ...]] = {}
        if isinstance(node, TestDecl):
            if node.nominal is not None:
                yield Occurrence(node.nominal.span, Target(Sort.DECLARED, node.nominal.text))
            asked = "" if node.request is None else node.request.skill.text
            skill = self.symbols.skills.get(asked)
            for parameter in () if skill is None else skill.parameters:
                scope[parameter.name.text] = (Target(Sort.PARAMETER, parameter.name.text, asked),)
        else:
            yield from self.names((node.policy, node.vehicle), Sort.DECLARED)
        yield from self._case(tuple(value for value in parts(node) if value is not node.name), scope)

    def scenario(self, node: ScenarioDecl) -> Iterator[Occurrence]:
        """A scenario."""
        yield from self.names((node.mission,), Sort.DECLARED)
        faults = [each for each in node.start if isinstance(each, FaultCall)]
        for incident in node.incidents:
            match incident.moment:
                case AfterStep(skill=skill):
                    yield from self.names((skill,), Sort.DECLARED)
                case OnCondition(condition=condition):
                    yield from self.within(condition, {})
            faults.append(incident.fault)
        for fault in faults:
            yield from self._fault(fault)
        for demand in node.demands:
            match demand:
                case Decides():
                    yield from self._case(demand.decision, {})
                case Flies(skill=name) | Lands(zone=name):
                    yield from self.names((name,), Sort.DECLARED)
                case Keeps(place=name) if name.text != OBSTACLE:
                    yield from self.names((name,), Sort.DECLARED)

    def _fault(self, fault: FaultCall) -> Iterator[Occurrence]:
        """A fault, and what its values name: messages, roles; the words of others belong to the fault."""
        yield from self.names((fault.name,), Sort.FAULT)
        for each in fault.arguments:
            sort = None if each.name is None else _OF_FAULTS.get(each.name.text)
            if sort is not None and isinstance(each.value, Reference):
                yield Occurrence(each.value.span, Target(sort, each.value.name))

    def _case(self, node: Any, scope: Scope) -> Iterator[Occurrence]:
        match node:
            case Asker():
                yield from () if node.role is None else self.role(node.role, {})
                yield from () if node.source is None else self.names((node.source,), Sort.SOURCE)
            case Assignment(subject=Named(name=name)):
                yield from self.reference(Reference(span=name.span, name=name.text), {})
                if node.cell.value is not None:
                    subject = Reference(span=name.span, name=name.text)
                    yield from self._compared(node.cell.value, subject, {})
            case Table():
                yield from self._table(node, scope)
            case Request():
                yield from self.names((node.skill,), Sort.DECLARED)
                yield from self.arguments(node.arguments, self.symbols.skills.get(node.skill.text), {})
                yield from self._case(node.asker, scope)
            case Expectation():
                yield from () if node.target is None else self.names((node.target,), Sort.DECLARED)
                yield from () if node.reason is None else self.names((node.reason,), Sort.REASON)
            case InPhase():
                yield from self.names((node.phase, *node.order), Sort.PHASE)
            case Node():
                role = getattr(node, "role", None)
                if isinstance(role, Name):
                    yield from self.role(role, {})
                condition = getattr(node, "condition", None)
                if condition is not None:
                    yield from self.within(condition, {})
                else:
                    for value in parts(node):
                        yield from self._case(value, scope)
            case tuple() if not isinstance(node, Span):
                for each in node:
                    yield from self._case(each, scope)

    def _table(self, table: Table, scope: Scope) -> Iterator[Occurrence]:
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
        """One side of a comparison, which may be a member of what the other side is."""
        if isinstance(side, Reference) and side.name not in scope and side.name not in self.symbols.declared:
            yield from self._member(side, other, scope)
        else:
            yield from self.within(side, scope)

    def _member(self, node: Reference, other: Any, scope: Scope) -> Iterator[Occurrence]:
        if isinstance(other, Reference):
            if other.name == PHASE and PHASE not in scope:
                yield Occurrence(node.span, Target(Sort.PHASE, node.name))
                return
            signal = None if other.name in scope else self.symbols.signals.get(other.name)
            enum = None if signal is None else self.symbols.enums.get(signal.type.text)
            if enum is not None and any(member.name.text == node.name for member in enum.members):
                yield Occurrence(node.span, Target(Sort.MEMBER, node.name, enum.name.text))
                return
            chosen = tuple(self._choices(node.name, scope.get(other.name, ())))
            if chosen:
                yield from (Occurrence(node.span, target) for target in chosen)
                return
        yield from self.reference(node, scope)

    def _choices(self, name: str, targets: Iterable[Target]) -> Iterator[Target]:
        for target in targets:
            owner = self.symbols.skills.get(target.owner) or self.symbols.missions.get(target.owner)
            for parameter in () if owner is None else owner.parameters:
                if parameter.name.text == target.name and any(each.text == name for each in parameter.choices):
                    yield Target(Sort.CHOICE, name, f"{target.owner}.{target.name}")
