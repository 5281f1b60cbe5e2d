"""The permissions of a policy: who may request which skill, and within which limits of height, speed and place.

`rights` sorts the rules by role and skill. `permitted_limits` gives the widest limits that the rules permit to anyone,
which may be narrower than those of the skill. No `permit` holds outside these limits (`analysis/extent.py`), so the
report never shows less than the policy permits.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Final, NamedTuple

from rtshcua.decision.prepare import Compiler
from rtshcua.decision.tree import AtMost, Negation, Node
from rtshcua.ground.analysis.extent import FAR, Bounds, Extents, alternatives
from rtshcua.ground.report.prose.condition_phrases import conjuncts, describe_clauses, describe_condition
from rtshcua.ground.report.prose.phrases import Vocabulary, listed
from rtshcua.ground.report.prose.rules_and_skills import approver, sources_of, through
from rtshcua.ground.report.report_model import PermittedLimit, PermitView, Restriction, Right, Rights
from rtshcua.ground.report.reported_policy import ReportedPolicy, within
from rtshcua.model.flat.contract import PLACE, QUANTITY, ZONE, Contract, Parameter, SourceKind
from rtshcua.model.flat.policy import Rule as FlatRule
from rtshcua.model.flat.policy import RuleKind
from rtshcua.model.ir.expression import Condition, Reference
from rtshcua.model.ir.policies import RuleDecl
from rtshcua.model.ir.skills import SkillDecl
from rtshcua.model.quantity import Dimension, display

#: stands for every role that no rule names
EVERYBODY_ELSE: Final = ""
YES, CONDITIONS, APPROVAL, REPLACED, NO = "yes", "on conditions", "after approval", "something else", "no"


def rights(subject: ReportedPolicy) -> tuple[Rights, ...]:
    """The rights of every role of the policy, and of everybody else."""
    skills = [contract.name for contract in subject.policy.contracts]
    return tuple(
        Rights(role, tuple(_right(subject, role, skill) for skill in skills))
        for role in (*subject.policy.roles, EVERYBODY_ELSE)
    )


def _right(subject: ReportedPolicy, role: str, skill: str) -> Right:
    ways: list[PermitView] = []
    confirmations: list[Restriction] = []
    prohibitions: list[Restriction] = []
    about = [(number, rule) for number, rule in enumerate(subject.rules, 1) if _about(rule, role, skill)]
    for number, rule in about:
        conditions = describe_clauses(rule.when, rule_names(subject, rule))
        match rule.kind:
            case "permit":
                ways.append(PermitView(number, through(sources_of(rule)), conditions))
            case "confirm":
                confirmations.append(Restriction(number, approver(rule), conditions))
            case "forbid":
                sources = f"asked through {through(sources_of(rule))}" if rule.through else ""
                prohibitions.append(Restriction(number, sources, conditions))
            case _:
                pass
    answer = _answer(skill, [rule for _, rule in about])
    return Right(skill, answer, tuple(ways), tuple(confirmations), tuple(prohibitions))


def _answer(skill: str, about: list[RuleDecl]) -> str:
    """Return the short answer, over the sources that some permit names and that are not always forbidden.

    `yes` means that through at least one source no condition applies. What is forbidden to other sources is ignored.
    """
    permits, forbids, confirms = (
        [rule for rule in about if rule.kind == kind] for kind in ("permit", "forbid", "confirm")
    )
    if not _sources(permits) - _sources(_unconditional(forbids)):
        return NO
    if any(rule.target is not None and rule.target.skill.text != skill for rule in _unconditional(about)):
        return REPLACED
    plainly = _sources(_unconditional(permits)) - _sources(forbids)
    if _unconditional(confirms):
        return APPROVAL if plainly else f"{APPROVAL}, {CONDITIONS}"
    return YES if plainly and not confirms else CONDITIONS


def _unconditional(rules: Iterable[RuleDecl]) -> list[RuleDecl]:
    return [rule for rule in rules if rule.when is None]


def _sources(rules: Iterable[RuleDecl]) -> frozenset[str]:
    return frozenset(source for rule in rules for source in sources_of(rule))


def _about(rule: RuleDecl, role: str, skill: str) -> bool:
    """Whether a rule applies to a skill and a role; a `confirm` applies to all roles."""
    if rule.skills and skill not in {name.text for name in rule.skills}:
        return False
    return not rule.roles or role in {name.text for name in rule.roles}


def rule_names(subject: ReportedPolicy, rule: RuleDecl) -> Vocabulary:
    """The vocabulary of a rule, which may read the arguments that all of its skills have."""
    own = [name.text for name in rule.skills] or [contract.name for contract in subject.policy.contracts]
    return vocabulary_of(subject, [subject.symbols.skills[name] for name in own])


def vocabulary_of(subject: ReportedPolicy, skills: Sequence[SkillDecl]) -> Vocabulary:
    """The vocabulary of a text about some skills, with the arguments that all of them have."""
    types = [{each.name.text: each.type.text for each in skill.parameters} for skill in skills]
    shared = frozenset.intersection(*map(frozenset, types)) if types else frozenset()
    places = [name for name in shared if all(each[name] == "position" for each in types)]
    return subject.names.asked(shared, places)


_ALWAYS: Final = AtMost((), 0)
#: the reported quantities, and their datum
_FROM: Final = {Dimension.ALTITUDE: " above home", Dimension.SPEED: ""}


class _PermitForRequester(NamedTuple):
    """The number of a `permit` for a requester, and the numbers of the `forbid` rules about this requester."""

    permit: int
    forbids: tuple[int, ...]


def permitted_limits(subject: ReportedPolicy) -> tuple[PermittedLimit, ...]:
    """Return the permitted limits of every height, speed and place that a step may request."""
    return tuple(_LimitFinder(subject).every())


class _LimitFinder:
    def __init__(self, subject: ReportedPolicy) -> None:
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

    def _ways(self, skill: int) -> Iterator[_PermitForRequester]:
        """Yield each `permit` of a skill for each requester to whom it is not always forbidden."""
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
                        yield _PermitForRequester(at, forbids)

    def _quantity(
        self, contract: Contract, parameter: Parameter, ways: Sequence[_PermitForRequester]
    ) -> Iterator[PermittedLimit]:
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

    def _reaches(self, contract: Contract, way: _PermitForRequester) -> list[Bounds]:
        """The permitted ranges by one permit: the skill's ranges, limited by the rules and the skill's `require`."""
        parts: list[Bounds] = [
            {(True, each.cell): (each.low, each.high) for each in contract.parameters if each.kind != PLACE}
        ]
        needed = [self._parts(self._compiler.node(clause, contract)) for clause in contract.require]
        some = [self._parts(self._nodes[way.permit]), *(self._parts(Negation(self._nodes[at])) for at in way.forbids)]
        for narrower in [*some, *needed]:
            if any(not bounds for bounds in narrower):
                continue  # it does not limit the arguments
            both = (_common(one, other) for one in parts for other in narrower)
            parts = _around([each for each in both if each is not None])
        return parts

    def _parts(self, node: Node) -> list[Bounds]:
        """The bounds of a condition on the arguments."""
        return [{cell: ends for cell, ends in part.items() if cell[0]} for part in self._extents.parts(node)]

    def _plain(self, way: _PermitForRequester, cell: tuple[bool, int], low: int, high: int) -> bool:
        """Whether the whole range from `low` to `high` is permitted without other conditions."""
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

    def _place(self, contract: Contract, parameter: Parameter, ways: Sequence[_PermitForRequester]) -> PermittedLimit:
        """The limits of a place in the words of the rules, and whether other conditions apply."""
        texts: dict[str, None] = {}
        everywhere, plain = False, False
        for way in ways:
            parts = conjuncts(self._subject.rules[way.permit].when)
            about = [each for each in parts if _reads(each, parameter.name)]
            forbidding = [at for at in way.forbids if self._reads(at, parameter.name)]
            plain |= len(about) == len(parts) and len(forbidding) == len(way.forbids)
            words = [self._words(way.permit, each) for each in about]
            words += [f"it is not so that ({self._whole(at)})" for at in forbidding]
            everywhere |= not words
            texts[listed(words)] = None
        limits = "wherever the airspace allows it" if everywhere else f"if {'; or if '.join(texts)}"
        return PermittedLimit(contract.name, parameter.name, "place", limits, not plain)

    def _reads(self, number: int, parameter: str) -> bool:
        when = self._subject.rules[number].when
        return when is not None and _reads(when, parameter)

    def _words(self, number: int, condition: Condition) -> str:
        return describe_condition(condition, rule_names(self._subject, self._subject.rules[number]))

    def _whole(self, number: int) -> str:
        when = self._subject.rules[number].when
        return "" if when is None else self._words(number, when)


def _reads(condition: Condition, parameter: str) -> bool:
    return any(isinstance(each, Reference) and each.name.split(".")[0] == parameter for each in within(condition))


def _meets(rule: FlatRule, role: int, source: int) -> bool:
    return (not rule.roles or role in rule.roles) and (not rule.sources or source in rule.sources)


def _common(one: Bounds, other: Bounds) -> Bounds | None:
    """The intersection of two bounds, by the cells of the first; None if it is empty."""
    made = {}
    for cell, (low, high) in one.items():
        least, most = other.get(cell, (-FAR, FAR))
        made[cell] = max(least, low), min(most, high)
        if made[cell][0] > made[cell][1]:
            return None
    return made


def _around(parts: list[Bounds]) -> list[Bounds]:
    """Return a few bounds unchanged, and many as one bound that contains all of them."""
    if len(parts) <= 8:
        return parts
    return [{cell: (min(each[cell][0] for each in parts), max(each[cell][1] for each in parts)) for cell in parts[0]}]
