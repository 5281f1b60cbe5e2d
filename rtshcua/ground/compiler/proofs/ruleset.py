"""The rules of a policy, as the checks of rules against each other ask about them.

A rule of the source may have become several flat ones: for skills that keep their arguments in different cells, and for
each use of a template or delegation. They count as one, which is reported only if what is said holds of all of them.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from typing import Final, NamedTuple, TypeAlias

from rtshcua.decision import tree
from rtshcua.decision.evaluate import Condition, Environment
from rtshcua.decision.values import Truth
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.analysis.solve import Answer, Goal, Undecided, Yes
from rtshcua.ground.analysis.space import Space
from rtshcua.ground.compiler.proofs.situation import Ground
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.policy import Rule, RuleKind
from rtshcua.model.flat.zone import Zone
from rtshcua.model.ir.policies import Rule as RuleDecl

#: the code of a condition; empty where a rule has none
Code: TypeAlias = tuple[int, ...]
#: the condition of a rule without one
ALWAYS: Final = tree.AtMost((), 0)
#: how many other rules are looked at together before a question is left open
_TOGETHER = 12


class Group(NamedTuple):
    """A rule of the source, and the numbers of what it was lowered to."""

    declared: RuleDecl
    span: Span
    kind: int
    rules: tuple[int, ...]


class Other(NamedTuple):
    """Other rules that may matter and have the same condition: their numbers, their code, and the condition as on
    board.
    """

    numbers: list[int]
    code: Code
    condition: Condition

    def one(self, but: AbstractSet[int]) -> int | None:
        """One of the rules that is not among some."""
        return next((number for number in self.numbers if number not in but), None)


class Key(NamedTuple):
    """A skill, a role and a source that stand for all that the same rules speak of."""

    skill: int
    role: int
    source: int


class Ruleset:
    """The rules of a prepared policy; remembers what was asked. `open` are the rules that were not decided on."""

    def __init__(self, ground: Ground) -> None:
        self.ground = ground
        self.policy = ground.prepared.policy
        self.groups = tuple(_groups(ground))
        self.at = {group.span: group for group in self.groups}
        self.open: set[Span] = set()
        self._nodes: dict[Code, tree.Node] = {(): ALWAYS}
        self._others: dict[tuple[Key, RuleKind], dict[Code, Other]] = {}
        self._roles = _representatives(
            range(len(self.policy.roles) + 1), [rule.roles for rule in self.policy.rules if rule.roles]
        )
        self._sources = _representatives(
            map(int, SourceKind), [rule.sources for rule in self.policy.rules if rule.sources]
        )

    def rule(self, number: int) -> Rule:
        """A flat rule."""
        return self.policy.rules[number]

    def code(self, number: int) -> Code:
        """The code of a flat rule's condition."""
        when = self.rule(number).when
        return () if when is None else when.code

    def node(self, number: int) -> tree.Node:
        """The condition of a flat rule."""
        code = self.code(number)
        found = self._nodes.get(code)
        if found is None:
            when = self.ground.prepared.compiler.when(self.rule(number))
            found = self._nodes[code] = ALWAYS if when is None else when
        return found

    def skills(self, number: int) -> Sequence[int]:
        """The skills that a flat rule is about."""
        return self.rule(number).skills or range(len(self.policy.contracts))

    def space(self, skill: int) -> Space:
        """Any situation in which a skill may be asked for."""
        return self.ground.questions.space(skill)

    def keys(self, number: int) -> Iterator[Key]:
        """The skills, roles and sources of a flat rule; one for all about which the policy's rules are the same."""
        rule = self.rule(number)
        roles = dict.fromkeys(self._roles[role] for role in rule.roles or self._roles)
        sources = dict.fromkeys(self._sources[source] for source in rule.sources or self._sources)
        for skill in self.skills(number):
            for role in roles:
                for source in sources:
                    yield Key(skill, role, source)

    def others(self, key: Key, kind: RuleKind) -> Mapping[Code, Other]:
        """The rules of a kind about a key, by their code."""
        found = self._others.get((key, kind))
        if found is None:
            found = self._others[key, kind] = {}
            candidates = self.ground.prepared.rules.candidates(*key)
            for rule in candidates.forbids if kind is RuleKind.FORBID else candidates.permits:
                code = self.code(rule.number)
                found.setdefault(code, Other([], code, rule.condition)).numbers.append(rule.number)
        return found

    def ask(self, goals: Sequence[tuple[int, Truth]], skill: int) -> Answer:
        """Whether, for a skill, the conditions of flat rules can have such truths at once."""
        key = ("rules", skill, *((self.code(number), wanted) for number, wanted in goals))

        def conditions() -> list[Goal]:
            return [(self.node(number), wanted) for number, wanted in goals]

        return self.ground.questions.ask(key, conditions, self.space(skill))

    def escapes(
        self, number: int, wanted: Truth, others: Mapping[Code, Other], but: AbstractSet[int], escape: Truth, skill: int
    ) -> tuple[Answer, tuple[int, ...]]:
        """Whether a rule's condition can have a truth where all others, but for some, have one of `escape`; and the
        others asked of.

        Only those others are asked of that a situation found so far was not an escape from.
        """
        used: list[int] = []
        same = None if wanted & escape else others.get(self.code(number))
        for other in (same, others.get(())):
            one = None if other is None else other.one(but)
            if one is not None and not used:
                used.append(one)
        while True:
            answer = self.ask([(number, wanted), *((other, escape) for other in used)], skill)
            if not isinstance(answer, Yes):
                return answer, tuple(used)
            at = answer.witness.at
            met = next((one for one in self._met(others, at, escape, but)), None)
            if met is None:
                return answer, tuple(used)
            if len(used) >= _TOGETHER:
                return Undecided("too many rules overlap with it"), tuple(used)
            used.append(met)

    def _met(
        self, others: Mapping[Code, Other], at: Environment, escape: Truth, but: AbstractSet[int]
    ) -> Iterator[int]:
        """The others, but for some, that do not have one of some truths in a situation; one for each condition."""
        for other in others.values():
            if not other.condition(at) & escape:
                one = other.one(but)
                if one is not None:
                    yield one

    def timed(self, number: int) -> bool:
        """Whether a rule's condition reads the time of day, by itself or through a zone."""
        return timed(self.code(number), self.policy.zones)

    def undecided(self, group: Group, what: str, why: str) -> None:
        """Say, once a rule, that a check could not decide."""
        if group.span not in self.open:
            self.open.add(group.span)
            self.ground.context.report.add(
                codes.UNDECIDED,
                group.span,
                f"it could not be decided whether this rule {what}",
                help=f"{why}; a simpler condition would do",
            )


def timed(code: Code, zones: Sequence[Zone]) -> bool:
    """Whether code reads the time of day, by itself or through a zone."""

    def at_times(zone: Zone) -> bool:
        return bool(zone.daily or zone.dates)

    return any(
        op == Op.TIME_IN
        or (op == Op.POSITION_IN and at_times(zones[a]))
        or (op == Op.ARGUMENT_POINT_IN and at_times(zones[b]))
        or (op == Op.POSITION_IN_ARGUMENT and any(map(at_times, zones)))
        for op, a, b in zip(code[::3], code[1::3], code[2::3], strict=True)
    )


def _groups(ground: Ground) -> Iterator[Group]:
    """The rules by the place where they are written, in the order of their last ones."""
    declared: dict[Span, RuleDecl] = {}
    for each in ground.lowered.declaration.rules:
        declared.setdefault(each.span, each)
    numbers: dict[Span, list[int]] = {}
    for number, rule in enumerate(ground.prepared.policy.rules):
        numbers.setdefault(ground.span(rule), []).append(number)
    for span, rules in numbers.items():
        if span in declared:
            yield Group(declared[span], span, ground.prepared.policy.rules[rules[0]].kind, tuple(rules))


def _representatives(members: Iterable[int], mentions: Iterable[tuple[int, ...]]) -> dict[int, int]:
    """For each member the least one that the same rules mention."""
    mentioned: dict[int, list[int]] = {member: [] for member in members}
    for at, mention in enumerate(mentions):
        for member in mention:
            mentioned[member].append(at)
    first: dict[tuple[int, ...], int] = {}
    return {member: first.setdefault(tuple(at), member) for member, at in mentioned.items()}
