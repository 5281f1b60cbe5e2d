"""What the rules let be asked for, over all who may ask: heights, speeds and places of each skill.

What a skill may be asked for is no promise of the policy: a rule may permit less. Bounds are those outside of which no
`permit` counts (`analysis/extent.py`), so nothing that is permitted lies beyond what is told.
"""

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from rtshcua.decision.prepare import Compiler
from rtshcua.decision.tree import AtMost, Negation, Node
from rtshcua.ground.analysis.extent import FAR, Bounds, Extents, alternatives
from rtshcua.ground.report.model import PermittedLimit
from rtshcua.ground.report.rights import rule_names
from rtshcua.ground.report.subject import Subject, within
from rtshcua.ground.report.words.conditions import conjuncts, told_condition
from rtshcua.ground.report.words.vocabulary import listed
from rtshcua.model.flat.contract import PLACE, QUANTITY, ZONE, Contract, Parameter, SourceKind
from rtshcua.model.flat.policy import Rule, RuleKind
from rtshcua.model.ir.expression import Condition, Reference
from rtshcua.model.quantity import Dimension, display

_ALWAYS: Final = AtMost((), 0)
#: the quantities that are told, and what a figure of them is measured from
_FROM: Final = {Dimension.ALTITUDE: " above home", Dimension.SPEED: ""}


class _Way(NamedTuple):
    """A `permit`, for some who ask, and the prohibitions about them; all by their numbers."""

    permit: int
    forbids: tuple[int, ...]


def permitted(subject: Subject) -> tuple[PermittedLimit, ...]:
    """What is permitted of every height, speed and place that some step may be asked for."""
    return tuple(_Permitted(subject).every())


class _Permitted:
    def __init__(self, subject: Subject) -> None:
        self._subject, self._policy = subject, subject.policy
        compiler = Compiler(subject.policy)
        self._nodes = [compiler.when(rule) or _ALWAYS for rule in self._policy.rules]
        self._extents = Extents(compiler.tables, self._policy.zones)
        self._compiler = compiler

    def every(self) -> Iterator[PermittedLimit]:
        for number, contract in enumerate(self._policy.contracts):
            ways = list(dict.fromkeys(self._ways(number)))
            for parameter in contract.parameters:
                if not ways:
                    break
                if parameter.kind == QUANTITY and Dimension(parameter.dimension) in _FROM:
                    yield from self._quantity(contract, parameter, ways)
                elif parameter.kind in (PLACE, ZONE):
                    yield self._place(contract, parameter, ways)

    def _ways(self, skill: int) -> Iterator[_Way]:
        """Each `permit` of a skill for each who may ask, where nothing forbids it to them always."""
        about = [(at, rule) for at, rule in enumerate(self._policy.rules) if not rule.skills or skill in rule.skills]
        for at, rule in about:
            if rule.kind != RuleKind.PERMIT:
                continue
            for role in rule.roles or range(-1, len(self._policy.roles)):
                for source in rule.sources or SourceKind:
                    forbids = tuple(
                        other for other, each in about if each.kind == RuleKind.FORBID and _meets(each, role, source)
                    )
                    if all(self._policy.rules[each].when is not None for each in forbids):
                        yield _Way(at, forbids)

    def _quantity(self, contract: Contract, parameter: Parameter, ways: Sequence[_Way]) -> Iterator[PermittedLimit]:
        cell = (True, parameter.cell)
        reaches = [each[cell] for way in ways for each in self._reaches(contract, way)]
        if not reaches:
            return
        low, high = min(low for low, _ in reaches), max(high for _, high in reaches)
        plain = any(self._plain(way, cell, low, high) for way in ways)
        dimension = Dimension(parameter.dimension)
        limits = f"between {display(low, dimension)} and {display(high, dimension)}{_FROM[dimension]}"
        if low == high:
            limits = f"exactly {display(low, dimension)}{_FROM[dimension]}"
        yield PermittedLimit(contract.name, parameter.name, parameter.dimension, limits, not plain)

    def _reaches(self, contract: Contract, way: _Way) -> list[Bounds]:
        """What may be asked for by one way: the skill's own ranges within what the rules and its `require` leave."""
        parts: list[Bounds] = [
            {(True, each.cell): (each.low, each.high) for each in contract.parameters if each.kind != PLACE}
        ]
        needed = [self._parts(self._compiler.node(clause, contract)) for clause in contract.require]
        some = [self._parts(self._nodes[way.permit]), *(self._parts(Negation(self._nodes[at])) for at in way.forbids)]
        for narrower in [*some, *needed]:
            if any(not bounds for bounds in narrower):
                continue  # it bounds nothing by itself
            both = (_common(one, other) for one in parts for other in narrower)
            parts = _around([each for each in both if each is not None])
        return parts

    def _parts(self, node: Node) -> list[Bounds]:
        """What a condition says of what is asked for."""
        return [{cell: ends for cell, ends in part.items() if cell[0]} for part in self._extents.parts(node)]

    def _plain(self, way: _Way, cell: tuple[bool, int], low: int, high: int) -> bool:
        """Whether all from `low` to `high` is permitted whatever else is so."""
        return all(
            any(
                not one.others
                and set(one.bounds) <= {cell}
                and one.bounds.get(cell, (-FAR, FAR))[0] <= low
                and one.bounds.get(cell, (-FAR, FAR))[1] >= high
                for one in alternatives(node)
            )
            for node in (self._nodes[way.permit], *(Negation(self._nodes[at]) for at in way.forbids))
            if node is not _ALWAYS
        )

    def _place(self, contract: Contract, parameter: Parameter, ways: Sequence[_Way]) -> PermittedLimit:
        """What the rules say of a place in their own words; what one says of other things too is under conditions."""
        told: dict[str, None] = {}
        everywhere, plain = False, False
        for way in ways:
            parts = conjuncts(self._subject.rules[way.permit].when)
            about = [each for each in parts if _reads(each, parameter.name)]
            forbidding = [at for at in way.forbids if self._reads(at, parameter.name)]
            plain |= len(about) == len(parts) and len(forbidding) == len(way.forbids)
            words = [self._words(way.permit, each) for each in about]
            words += [f"it is not so that ({self._whole(at)})" for at in forbidding]
            everywhere |= not words
            told[listed(words)] = None
        limits = "wherever the airspace allows it" if everywhere else f"if {'; or if '.join(told)}"
        return PermittedLimit(contract.name, parameter.name, "place", limits, not plain)

    def _reads(self, number: int, parameter: str) -> bool:
        when = self._subject.rules[number].when
        return when is not None and _reads(when, parameter)

    def _words(self, number: int, condition: Condition) -> str:
        return told_condition(condition, rule_names(self._subject, self._subject.rules[number]))

    def _whole(self, number: int) -> str:
        when = self._subject.rules[number].when
        return "" if when is None else self._words(number, when)


def _reads(condition: Condition, parameter: str) -> bool:
    return any(isinstance(each, Reference) and each.name.split(".")[0] == parameter for each in within(condition))


def _meets(rule: Rule, role: int, source: int) -> bool:
    return (not rule.roles or role in rule.roles) and (not rule.sources or source in rule.sources)


def _common(one: Bounds, other: Bounds) -> Bounds | None:
    """What two have in common, by the cells of the first; None where nothing is."""
    made = {}
    for cell, (low, high) in one.items():
        least, most = other.get(cell, (-FAR, FAR))
        made[cell] = max(least, low), min(most, high)
        if made[cell][0] > made[cell][1]:
            return None
    return made


def _around(parts: list[Bounds]) -> list[Bounds]:
    """A few bounds as they are, of many what is around them all."""
    if len(parts) <= 8:
        return parts
    return [{cell: (min(each[cell][0] for each in parts), max(each[cell][1] for each in parts)) for cell in parts[0]}]
