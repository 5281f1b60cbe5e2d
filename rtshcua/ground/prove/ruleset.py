"""The rules of a policy, as the checks of rules against each other ask about them.

A rule of the source may have become several flat ones: for skills that keep their arguments in different cells, and for
each use of a template or delegation. They count as one, which is reported only if what is said holds of all of them.
"""

from collections.abc import Hashable, Iterable, Iterator, Sequence
from collections.abc import Set as AbstractSet
from heapq import merge
from itertools import product
from typing import NamedTuple, TypeAlias

from rtshcua.decision import tree
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.prepare import ANY
from rtshcua.decision.times import timed as at_times
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN, Truth, point
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.analysis.box import Cell, clipped
from rtshcua.ground.analysis.extent import PHASE, Conjunction, Extents, alternatives
from rtshcua.ground.analysis.solve import Answer, Goal, No, Undecided, Yes
from rtshcua.ground.analysis.space import SituationSpace
from rtshcua.ground.analysis.witness import plain
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.rule_index import IndexedRule, RuleBoundsIndex, RuleQuery
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.policy import Rule, RuleKind
from rtshcua.model.flat.zone import Zone
from rtshcua.model.ir.policies import RuleDecl as RuleDecl

#: the code of a condition; empty where a rule has none
Code: TypeAlias = tuple[int, ...]
#: how many other rules are looked at together before a question is left open
_TOGETHER = 12
#: of a rule's bounds, so many are gone to the ends of, in all ways
_CORNERS = 3
#: what all questions about the rules of one policy may take: boxes times conditions
MOST_EFFORT = 60_000
#: so many conditions are evaluated in the time of one box
_EVALUATIONS = 16


class WrittenRule(NamedTuple):
    """A rule of the source, and the numbers of what it was lowered to."""

    declared: RuleDecl
    span: Span
    kind: int
    rules: tuple[int, ...]


class RuleSubject(NamedTuple):
    """A skill, a role and a source that stand for all that the same rules speak of."""

    skill: int
    role: int
    source: int


class Ruleset:
    """The rules of a prepared policy; remembers what was asked. `open` are the rules that were not decided on."""

    def __init__(self, proof: ProofContext) -> None:
        self.proof = proof
        self.policy = proof.policy
        self.groups = tuple(_groups(proof))
        self.at = {group.span: group for group in self.groups}
        self.open: set[Span] = set()
        self._effort = 0
        self._exact: dict[Code, tuple[Conjunction, ...]] = {}
        self._within: dict[tuple[int, int], bool] = {}
        self._extents = Extents(self.proof.prepared.tables, self.policy.zones)
        self._plain: dict[int, Environment] = {}
        self._situations: dict[tuple[int, int], tuple[Environment, ...]] = {}
        self._overlaps: dict[int, RuleBoundsIndex] = {}
        self._left_out: set[int] = set()
        self._alike: dict[tuple[int, Code, int], list[int]] = {}
        self._effects: dict[Hashable, int] = {}
        self._next: dict[int, int] = {}
        self._group_of = {number: at for at, group in enumerate(self.groups) for number in group.rules}
        for number, rule in enumerate(self.policy.rules):
            for skill in rule.skills or (ANY,):
                self._alike.setdefault((rule.kind, self.code(number), skill), []).append(number)
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
        return self.proof.node(self.rule(number))

    def skills(self, number: int) -> Sequence[int]:
        """The skills that a flat rule is about."""
        return self.rule(number).skills or range(len(self.policy.contracts))

    def skills_decided(self, number: int) -> list[int]:
        """The skills that a flat rule decides on: not the one that it flies itself."""
        return [skill for skill in self.skills(number) if skill != self.flown(number)]

    def flown(self, number: int) -> int | None:
        """The skill that a `degrade` flies."""
        target = self.rule(number).target
        return None if target is None else target.skill

    def space(self, skill: int) -> SituationSpace:
        """Any situation in which a skill may be asked for."""
        return self.proof.questions.space(skill)

    def keys(self, number: int) -> Iterator[RuleSubject]:
        """The skills, roles and sources of a flat rule; one for all about which the policy's rules are the same."""
        rule = self.rule(number)
        roles = dict.fromkeys(self._roles[role] for role in rule.roles or self._roles)
        sources = dict.fromkeys(self._sources[source] for source in rule.sources or self._sources)
        for skill in self.skills(number):
            for role in roles:
                for source in sources:
                    yield RuleSubject(skill, role, source)

    @property
    def effort(self) -> int:
        """What all questions took so far."""
        return self._effort // _EVALUATIONS

    @property
    def exhausted(self) -> bool:
        """Whether the rules took so much already that no more is asked about them."""
        return self._effort >= MOST_EFFORT * _EVALUATIONS

    def ask(self, goals: Sequence[tuple[int, Truth]], skill: int) -> Answer:
        """Whether, for a skill, the conditions of flat rules can have such truths at once."""
        key = self._question(goals, skill)

        def conditions() -> list[Goal]:
            return [(self.node(number), wanted) for number, wanted in goals]

        answer = self.proof.questions.ask(key, conditions, self.space(skill))
        self._effort += self.proof.questions.effort(key) * _EVALUATIONS
        return answer

    def never(self, goals: Sequence[tuple[int, Truth]], skill: int) -> bool:
        """Whether it is proved that the conditions of flat rules never have such truths at once."""
        return isinstance(self.ask(goals, skill), No)

    def known(self, goals: Sequence[tuple[int, Truth]], skill: int) -> Answer | None:
        """The answer to a question, if it was asked."""
        return self.proof.questions.known(self._question(goals, skill))

    def _question(self, goals: Sequence[tuple[int, Truth]], skill: int) -> Hashable:
        return ("rules", skill, *((self.code(number), wanted) for number, wanted in goals))

    def drop(self, numbers: Iterable[int]) -> None:
        """Look at some rules no more when asking about others."""
        for number in numbers:
            self._left_out.add(number)
            kind = self.rule(number).kind
            if kind in self._overlaps:
                self._overlaps[kind].remove(number)

    def group_of(self, number: int) -> int:
        """Of which group, by its place among all, a flat rule is."""
        return self._group_of[number]

    def effect(self, number: int) -> int:
        """What a rule does where its condition holds: the same number for the same."""
        rule = self.rule(number)
        does = (rule.approver, rule.second) if rule.target is None else (rule.target.skill, rule.target.arguments)
        return self._effects.setdefault(does, len(self._effects))

    def other_effect_after(self, number: int) -> int:
        """The number of the next `degrade` after one that flies something else; more than any where there is none."""
        if not self._next:
            last = other = len(self.policy.rules)
            for each in range(len(self.policy.rules) - 1, -1, -1):
                if self.rule(each).kind == RuleKind.DEGRADE:
                    if last < len(self.policy.rules) and self.effect(each) != self.effect(last):
                        other = last
                    self._next[each] = other
                    last = each
        return self._next[number]

    def holds(self, number: int, at: Environment) -> Truth:
        """The truth of a rule's condition in a situation."""
        self._effort += 1
        return self.proof.condition(self.rule(number))(at)

    def may_match(self, number: int, skill: int) -> bool | None:
        """Whether the condition of a rule can be true; None where that is best asked of the analysis."""
        certain = any(not each.others for each in self._alternatives(number))
        return True if certain and self.situations(number, skill) else None

    def situations(self, number: int, skill: int) -> tuple[Environment, ...]:
        """Some situations in which the condition of a rule is true, as far apart as its bounds allow; none, where none
        was found.
        """
        found = self._situations.get((number, skill))
        if found is None:
            found = self._situations[number, skill] = tuple(self._ends(number, skill))
        return found

    def _alternatives(self, number: int) -> tuple[Conjunction, ...]:
        code = self.code(number)
        found = self._exact.get(code)
        if found is None:
            found = self._exact[code] = alternatives(self.node(number))
        return found

    def _ends(self, number: int, skill: int) -> Iterator[Environment]:
        space = self.space(skill)
        if skill not in self._plain:
            self._plain[skill] = plain(space)
        found: Environment | None = None
        for exact in self._alternatives(number):
            if exact.others and found is None:
                answer = self.ask([(number, TRUE)], skill)
                if not isinstance(answer, Yes):
                    return
                found = answer.witness.at
                yield found
            start = found if exact.others and found is not None else self._plain[skill]
            cells = [cell for cell in exact.bounds if cell != PHASE]
            for corner in _corners(space, exact, cells):
                arguments, slots = list(start.arguments), list(start.slots)
                for (argument, at), value in zip(cells, corner, strict=True):
                    (arguments if argument else slots)[at] = point(value)
                made = Environment(slots, arguments, start.utc, start.error, None, start.monitors, start.phase)
                if self.holds(number, made) == TRUE:
                    yield made

    def _implies(self, one: tree.Node, other: tree.Node) -> bool:
        """Whether a place is inside one zone wherever it is inside another; not, where zones have times."""
        if not isinstance(one, tree.PointInside) or not isinstance(other, tree.PointInside) or one.cell != other.cell:
            return False
        pair = (one.zone, other.zone)
        found = self._within.get(pair)
        if found is None:
            zones = self.policy.zones
            sometimes = any(at_times(zones[each]) for each in pair)
            found = self._within[pair] = not sometimes and self.space(0).plane.within(*pair)
        return found

    def overlaps(self, kind: int) -> RuleBoundsIndex:
        """The rules of a kind, by what their conditions can hold in; without those that were dropped."""
        found = self._overlaps.get(kind)
        if found is None:
            numbers = (
                each for each, rule in enumerate(self.policy.rules) if rule.kind == kind and each not in self._left_out
            )
            found = self._overlaps[kind] = RuleBoundsIndex(
                (
                    IndexedRule(
                        each,
                        self.rule(each),
                        self._extents.parts(self.node(each)),
                        self._alternatives(each),
                        self.effect(each) if kind in (RuleKind.CONFIRM, RuleKind.DEGRADE) else 0,
                    )
                    for each in numbers
                ),
                self._implies,
            )
        return found

    def candidates(
        self, kind: RuleKind, number: int, queries: Sequence[RuleQuery], but: AbstractSet[int], *, sure: bool
    ) -> Iterator[int]:
        """The rules of a kind, in order and but for some, that queries for one skill find and that may be true wherever
        a rule is (with `sure` unset: true or unknown, wherever it is either); each is to be asked about.
        """
        wanted, escape = (TRUE, FALSE | UNKNOWN) if sure else (TRUE | UNKNOWN, FALSE)
        skill, index = queries[0].skill, self.overlaps(kind)
        points = list(self.situations(number, skill))
        found = merge(*(index.meeting(each, points, sure=sure) for each in queries))
        while not self.exhausted:
            candidate = next(found, None)
            if candidate is None:
                return
            if candidate in but or any(self.holds(candidate, at) & escape for at in points):
                continue
            yield candidate
            answer = self.known([(number, wanted), (candidate, escape)], skill)
            if isinstance(answer, Yes):  # nor does any other that is not there what it should be
                points.append(answer.witness.at)
                found = merge(*(index.meeting(each, points, sure=sure, after=candidate) for each in queries))

    def wider(self, candidate: int, number: int, skill: int) -> bool:
        """Whether a rule is about a skill, and about all roles and sources of another rule."""
        one, other = self.rule(candidate), self.rule(number)
        return (
            skill in self.skills(candidate)
            and _has_all(one.roles, other.roles)
            and _has_all(one.sources, other.sources)
        )

    def covered(
        self, number: int, wanted: Truth, kind: RuleKind, but: AbstractSet[int], escape: Truth, key: RuleSubject
    ) -> tuple[int, ...] | Undecided | None:
        """Rules of a kind about a key, but for some, of which one has none of the truths `escape` wherever a rule's
        condition has the truth `wanted`; None where there is a situation without such a rule.

        Only those rules are asked of that a situation found so far was not an escape from.
        """
        for one in self._alike_rules(number, kind, but, key):
            return (one,)
        about = RuleQuery(key.skill, (key.role,), (key.source,))
        holding = [self._holding(about, key, kind, exact, but) for exact in self._alternatives(number)]
        found = tuple(dict.fromkeys(one for one in holding if one is not None))
        if None not in holding:
            return found
        situations = self.situations(number, key.skill) if wanted == TRUE else ()
        if any(self._met(about, key, kind, at, escape, but) is None for at in situations):
            return None
        used: list[int] = []
        while not self.exhausted:
            answer = self.ask([(number, wanted), *((other, escape) for other in used)], key.skill)
            if not isinstance(answer, Yes):
                return answer if isinstance(answer, Undecided) else tuple(used)
            met = self._met(about, key, kind, answer.witness.at, escape, but)
            if met is None:
                return None
            if len(used) >= _TOGETHER:
                return Undecided("too many rules overlap with it")
            used.append(met)
        return None

    def _alike_rules(self, number: int, kind: RuleKind, but: AbstractSet[int], key: RuleSubject) -> Iterator[int]:
        """The rules about a key, but for some, of the same condition as a rule, or of none."""
        for code in dict.fromkeys((self.code(number), ())):
            alike = merge(*(self._alike.get((kind, code, skill), ()) for skill in (key.skill, ANY)))
            yield from (each for each in alike if each not in but and self._about(each, key))

    def _holding(
        self, about: RuleQuery, key: RuleSubject, kind: int, exact: Conjunction, but: AbstractSet[int]
    ) -> int | None:
        """A rule, but for some, that is seen to hold wherever a conjunction does."""
        for number in self.overlaps(kind).holding(about, exact):
            self._effort += 1
            if number not in but and self._about(number, key):
                return number
            if self.exhausted:
                break
        return None

    def _met(
        self, about: RuleQuery, key: RuleSubject, kind: int, at: Environment, escape: Truth, but: AbstractSet[int]
    ) -> int | None:
        """The first of the rules, but for some, that does not have one of some truths in a situation."""
        for number in self.overlaps(kind).meeting(about, (at,), sure=bool(escape & UNKNOWN)):
            if not self.holds(number, at) & escape and number not in but and self._about(number, key):
                return number
            if self.exhausted:
                break
        return None

    def _about(self, number: int, key: RuleSubject) -> bool:
        """Whether a rule is about a key; none is about the skill that it flies itself."""
        rule = self.rule(number)
        return (
            (rule.target is None or rule.target.skill != key.skill)
            and (not rule.skills or key.skill in rule.skills)
            and (not rule.roles or key.role in rule.roles)
            and (not rule.sources or key.source in rule.sources)
        )

    def timed(self, number: int) -> bool:
        """Whether a rule's condition reads the time of day, by itself or through a zone."""
        return timed(self.code(number), self.policy.zones)

    def undecided(self, group: WrittenRule, what: str, why: str) -> None:
        """Say, once a rule, that a check could not decide."""
        if group.span not in self.open:
            self.open.add(group.span)
            self.proof.report.add(
                codes.UNDECIDED,
                group.span,
                f"it could not be decided whether this rule {what}",
                help=f"{why}; a simpler condition would do",
            )


def _has_all(wider: tuple[int, ...], narrower: tuple[int, ...]) -> bool:
    """Whether a list of roles or sources, where none means any, has all of another."""
    return not wider or (bool(narrower) and set(narrower) <= set(wider))


def _corners(space: SituationSpace, exact: Conjunction, cells: Sequence[Cell]) -> Iterable[tuple[int, ...]]:
    """The values of some cells at the ends of their bounds (of many, all at the lower or all at the upper ones), and in
    the middle of them.
    """
    ends: list[tuple[int, int]] = []
    for cell in cells:
        value = clipped((space.arguments if cell[0] else space.slots)[cell[1]], *exact.bounds[cell])
        if value is None:
            return ()
        ends.append(value[:2])
    corners = product(*ends) if len(cells) <= _CORNERS else zip(*ends, strict=True)
    return dict.fromkeys((*corners, tuple((low + high) // 2 for low, high in ends)))


def timed(code: Code, zones: Sequence[Zone]) -> bool:
    """Whether code reads the time of day or of the week, by itself or through a zone."""
    return any(
        op in (Op.TIME_IN, Op.WEEK_IN)
        or (op == Op.POSITION_IN and at_times(zones[a]))
        or (op == Op.ARGUMENT_POINT_IN and at_times(zones[b]))
        or (op == Op.POSITION_IN_ARGUMENT and any(map(at_times, zones)))
        for op, a, b in zip(code[::3], code[1::3], code[2::3], strict=True)
    )


def _groups(proof: ProofContext) -> Iterator[WrittenRule]:
    """The rules by the place where they are written, in the order of their last ones."""
    declared: dict[Span, RuleDecl] = {}
    for each in proof.lowered.declaration.rules:
        declared.setdefault(each.span, each)
    numbers: dict[Span, list[int]] = {}
    for number, rule in enumerate(proof.policy.rules):
        numbers.setdefault(proof.span(rule), []).append(number)
    for span, rules in numbers.items():
        if span in declared:
            yield WrittenRule(declared[span], span, proof.policy.rules[rules[0]].kind, tuple(rules))


def _representatives(members: Iterable[int], mentions: Iterable[tuple[int, ...]]) -> dict[int, int]:
    """For each member the least one that the same rules mention."""
    mentioned: dict[int, list[int]] = {member: [] for member in members}
    for at, mention in enumerate(mentions):
        for member in mention:
            mentioned[member].append(at)
    first: dict[tuple[int, ...], int] = {}
    return {member: first.setdefault(tuple(at), member) for member, at in mentioned.items()}
