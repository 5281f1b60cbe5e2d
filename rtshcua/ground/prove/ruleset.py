"""The rules of a policy, and questions about them, for the checks that compare rules with each other.

A rule of the source may be lowered to several flat rules: for skills with different cells for their arguments, and for
each use of a template or delegation. They form one group, which is reported only if all its flat rules have the fault.
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

#: the code of a condition; empty for a rule without one
Code: TypeAlias = tuple[int, ...]
#: most rules that are considered together before a question stays undecided
_TOGETHER = 12
#: most bounds of a rule of which all combinations of ends are tried
_CORNERS = 3
#: most effort for all questions about the rules of one policy, in boxes times conditions
MOST_EFFORT = 60_000
#: the number of evaluations of a condition that take as long as one box
_EVALUATIONS = 16


class WrittenRule(NamedTuple):
    """A rule of the source, and the numbers of its flat rules."""

    declared: RuleDecl
    span: Span
    kind: int
    rules: tuple[int, ...]


class RuleSubject(NamedTuple):
    """A skill, a role and a source, representing all others to which the same rules apply."""

    skill: int
    role: int
    source: int


class Ruleset:
    """The rules of a prepared policy, with cached answers. `open` are the rules with an undecided question."""

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
        """Return a flat rule."""
        return self.policy.rules[number]

    def code(self, number: int) -> Code:
        """Return the code of a flat rule's condition."""
        when = self.rule(number).when
        return () if when is None else when.code

    def node(self, number: int) -> tree.Node:
        """Return the condition of a flat rule as a tree."""
        return self.proof.node(self.rule(number))

    def skills(self, number: int) -> Sequence[int]:
        """Return the skills to which a flat rule applies."""
        return self.rule(number).skills or range(len(self.policy.contracts))

    def skills_decided(self, number: int) -> list[int]:
        """Return the skills that a flat rule decides on: all to which it applies except its target."""
        return [skill for skill in self.skills(number) if skill != self.flown(number)]

    def flown(self, number: int) -> int | None:
        """Return the target skill of a `degrade`, or None."""
        target = self.rule(number).target
        return None if target is None else target.skill

    def space(self, skill: int) -> SituationSpace:
        """Return all situations in which a skill may be requested."""
        return self.proof.questions.space(skill)

    def keys(self, number: int) -> Iterator[RuleSubject]:
        """Yield the subjects of a flat rule, one for each class to which the same rules apply."""
        rule = self.rule(number)
        roles = dict.fromkeys(self._roles[role] for role in rule.roles or self._roles)
        sources = dict.fromkeys(self._sources[source] for source in rule.sources or self._sources)
        for skill in self.skills(number):
            for role in roles:
                for source in sources:
                    yield RuleSubject(skill, role, source)

    @property
    def effort(self) -> int:
        """The effort of all questions so far."""
        return self._effort // _EVALUATIONS

    @property
    def exhausted(self) -> bool:
        """Whether the limit of the effort is reached."""
        return self._effort >= MOST_EFFORT * _EVALUATIONS

    def ask(self, goals: Sequence[tuple[int, Truth]], skill: int) -> Answer:
        """Return whether the conditions of flat rules can have these truth values together, for a skill."""
        key = self._question(goals, skill)

        def conditions() -> list[Goal]:
            return [(self.node(number), wanted) for number, wanted in goals]

        answer = self.proof.questions.ask(key, conditions, self.space(skill))
        self._effort += self.proof.questions.effort(key) * _EVALUATIONS
        return answer

    def never(self, goals: Sequence[tuple[int, Truth]], skill: int) -> bool:
        """Whether it is proved that the conditions of flat rules never have these truth values together."""
        return isinstance(self.ask(goals, skill), No)

    def known(self, goals: Sequence[tuple[int, Truth]], skill: int) -> Answer | None:
        """Return the answer to an earlier question, or None."""
        return self.proof.questions.known(self._question(goals, skill))

    def _question(self, goals: Sequence[tuple[int, Truth]], skill: int) -> Hashable:
        return ("rules", skill, *((self.code(number), wanted) for number, wanted in goals))

    def drop(self, numbers: Iterable[int]) -> None:
        """Ignore some rules in questions about others."""
        for number in numbers:
            self._left_out.add(number)
            kind = self.rule(number).kind
            if kind in self._overlaps:
                self._overlaps[kind].remove(number)

    def group_of(self, number: int) -> int:
        """Return the index of the group of a flat rule."""
        return self._group_of[number]

    def effect(self, number: int) -> int:
        """Return a number for the effect of a rule, equal for equal effects."""
        rule = self.rule(number)
        does = (rule.approver, rule.second) if rule.target is None else (rule.target.skill, rule.target.arguments)
        return self._effects.setdefault(does, len(self._effects))

    def other_effect_after(self, number: int) -> int:
        """Return the next `degrade` after `number` with another effect, or the number of rules if there is none."""
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
        """Return the truth value of a rule's condition in a situation."""
        self._effort += 1
        return self.proof.condition(self.rule(number))(at)

    def may_match(self, number: int, skill: int) -> bool | None:
        """Return True if a rule's condition is known to become true, or None if the analysis must decide."""
        certain = any(not each.others for each in self._alternatives(number))
        return True if certain and self.situations(number, skill) else None

    def situations(self, number: int, skill: int) -> tuple[Environment, ...]:
        """Return some situations in which the condition of a rule is true, as far apart as its bounds allow."""
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
        """Whether a place inside the first zone is inside the second. False for zones with times."""
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
        """Return the index of the rules of a kind, without the dropped ones."""
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
        """Yield in order the rules of a kind, except `but`, that may be true wherever a rule is true.

        Without `sure`: true or unknown wherever the rule is true or unknown. All queries are for one skill. The caller
        proves each candidate.
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
            if isinstance(answer, Yes):  # its witness excludes other candidates too
                points.append(answer.witness.at)
                found = merge(*(index.meeting(each, points, sure=sure, after=candidate) for each in queries))

    def wider(self, candidate: int, number: int, skill: int) -> bool:
        """Whether the candidate applies to a skill, and to all roles and sources of a rule."""
        one, other = self.rule(candidate), self.rule(number)
        return (
            skill in self.skills(candidate)
            and _has_all(one.roles, other.roles)
            and _has_all(one.sources, other.sources)
        )

    def covered(
        self, number: int, wanted: Truth, kind: RuleKind, but: AbstractSet[int], escape: Truth, key: RuleSubject
    ) -> tuple[int, ...] | Undecided | None:
        """Return rules of a kind that together cover a rule for a subject, or None if they do not.

        They cover it if, wherever its condition has the truth value `wanted`, one of them has none of the truth values
        `escape`. The rules `but` are ignored. Rules are added one by one: each covers a situation that those before do
        not cover.
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
        """Yield the rules for a subject, except `but`, with the same condition as a rule, or without one."""
        for code in dict.fromkeys((self.code(number), ())):
            alike = merge(*(self._alike.get((kind, code, skill), ()) for skill in (key.skill, ANY)))
            yield from (each for each in alike if each not in but and self._about(each, key))

    def _holding(
        self, about: RuleQuery, key: RuleSubject, kind: int, exact: Conjunction, but: AbstractSet[int]
    ) -> int | None:
        """Return a rule, not in `but`, whose bounds show that it holds wherever a conjunction does; else None."""
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
        """Return the first rule, not in `but`, that has none of the truth values `escape` in a situation; else None."""
        for number in self.overlaps(kind).meeting(about, (at,), sure=bool(escape & UNKNOWN)):
            if not self.holds(number, at) & escape and number not in but and self._about(number, key):
                return number
            if self.exhausted:
                break
        return None

    def _about(self, number: int, key: RuleSubject) -> bool:
        """Whether a rule applies to a subject. A degrade does not apply to its own target."""
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

    def undecided(self, group: WrittenRule, question: str, reason: str) -> None:
        """Report that a check could not decide a question about a rule, once for each rule."""
        if group.span not in self.open:
            self.open.add(group.span)
            self.proof.report.add(
                codes.UNDECIDED,
                group.span,
                f"the analysis could not decide whether this rule {question}",
                help=f"{reason}; use a simpler condition",
            )


def _has_all(wider: tuple[int, ...], narrower: tuple[int, ...]) -> bool:
    """Whether a list of roles or sources contains all of another. An empty list means any."""
    return not wider or (bool(narrower) and set(narrower) <= set(wider))


def _corners(space: SituationSpace, exact: Conjunction, cells: Sequence[Cell]) -> Iterable[tuple[int, ...]]:
    """Return values of cells at the ends and in the middle of their bounds.

    For more than `_CORNERS` cells, only the combinations with all lower or all upper ends are included.
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
    """Yield the flat rules grouped by the rule of the source."""
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
    """Return for each member the least member that the same rules mention."""
    mentioned: dict[int, list[int]] = {member: [] for member in members}
    for at, mention in enumerate(mentions):
        for member in mention:
            mentioned[member].append(at)
    first: dict[tuple[int, ...], int] = {}
    return {member: first.setdefault(tuple(at), member) for member, at in mentioned.items()}
