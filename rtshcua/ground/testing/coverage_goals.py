"""The coverage items of a policy: its clauses, each with the results that it can have.

Clauses are the rules after elaboration (those of templates and delegations are shown after the `use` or `delegate` that
made them), the airspace, and for each permitted skill its `require`, `assume` and `maintain` clauses and its charge.
One more item is for the outcomes of the policy's decisions.

A result is excluded if the analysis of the compiler's proofs shows that it is impossible. All other results count, even
if no situation leads to them.
"""

from collections.abc import Iterable, Iterator, Sequence
from enum import StrEnum
from typing import NamedTuple

from rtshcua.decision import tree
from rtshcua.decision.contracts import Energy
from rtshcua.decision.prepare import PreparedPolicy
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN, Truth
from rtshcua.ground.analysis.solve import No, Questions
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.limits import FULL, MAX_TEXT
from rtshcua.model.flat.policy import Airspace, Rule, RuleKind
from rtshcua.model.outcome import Outcome


class Goal(StrEnum):
    """A coverage goal. For a clause: a truth, or that it decided. For a policy's decisions: an outcome."""

    TRUE = "true"
    FALSE = "false"
    UNKNOWN = "unknown"
    DECIDED = "decided"
    ALLOW = "allow"
    DENY = "deny"
    DEFER = "defer"
    FALLBACK = "fallback"


#: the goals of truths and of outcomes
TRUTHS: dict[Truth, Goal] = {TRUE: Goal.TRUE, FALSE: Goal.FALSE, UNKNOWN: Goal.UNKNOWN}
OUTCOMES: dict[Outcome, Goal] = {outcome: Goal(outcome.name.lower()) for outcome in Outcome}

#: the roles of items that are not in a list of clauses
ENERGY, AIRSPACE, DECISIONS = "energy", "airspace", "outcomes"
#: us: a clock error that makes the time unknown near a limit
_CLOCK_ERROR = 1_000_000
ENERGY_TEXT = "the charge to finish, to come home, and the reserve"


class Where(NamedTuple):
    """The place of a clause: an index into the policy's `sources`, and character offsets."""

    source: int
    start: int
    end: int


class CoverageItem(NamedTuple):
    """A coverage item. `skill` is the name of its skill, "" for an item of the policy itself.

    `goals` are those that count, in the order of `Goal`; `impossible` are those that cannot be reached.
    """

    role: str
    skill: str
    text: str
    where: Where | None
    goals: tuple[Goal, ...]
    impossible: tuple[Goal, ...]


class Universe(NamedTuple):
    """All coverage items of a policy, in source order, with indexes by rule and by the number of the skill."""

    prepared: PreparedPolicy
    items: tuple[CoverageItem, ...]
    rules: dict[Rule, int]
    clauses: dict[tuple[int, str, Clause], int]
    energy: dict[int, int]
    airspace: int | None
    decisions: int

    @property
    def total(self) -> int:
        """The number of goals."""
        return sum(len(item.goals) for item in self.items)


def universe_of(prepared: PreparedPolicy) -> Universe:
    """Return the coverage items of a policy."""
    policy, builder = prepared.policy, _ItemBuilder(prepared)
    items: list[CoverageItem] = []
    rules: dict[Rule, int] = {}
    for group in _written(policy.rules):
        rules |= dict.fromkeys(group, len(items))
        items.append(builder.rule(group))
    airspace = None
    if policy.airspace is not None:
        airspace = len(items)
        items.append(_airspace(policy.airspace))
    clauses: dict[tuple[int, str, Clause], int] = {}
    energy: dict[int, int] = {}
    for skill in _permitted(policy.rules, len(policy.contracts)):
        contract = policy.contracts[skill]
        for role, clause in clauses_of(contract):
            clauses[skill, role, clause] = len(items)
            items.append(builder.clause(skill, role, clause))
        energy[skill] = len(items)
        items.append(builder.energy(contract))
    decisions = len(items)
    items.append(CoverageItem(DECISIONS, "", "the outcomes of its decisions", None, tuple(OUTCOMES.values()), ()))
    return Universe(prepared, tuple(items), rules, clauses, energy, airspace, decisions)


def clauses_of(contract: Contract) -> Iterator[tuple[str, Clause]]:
    """Yield the clauses of a contract, each with the keyword of its list."""
    for role, clauses in (("require", contract.require), ("assume", contract.assume), ("maintain", contract.maintain)):
        for clause in clauses:
            yield role, clause


def _written(rules: Iterable[Rule]) -> Iterable[list[Rule]]:
    """Group the flat rules by the source rule: one over skills with arguments in different cells became several.

    If the text was truncated, the rest may differ, so that only rules over different skills count as one source rule.
    """
    groups: dict[object, list[list[Rule]]] = {}
    for rule in rules:
        key = (
            rule.kind,
            rule.source,
            rule.start,
            rule.end,
            rule.text,
            rule.roles,
            rule.sources,
            rule.approver,
            rule.second,
        )
        made = groups.setdefault(key, [])
        if made and (len(rule.text) < MAX_TEXT or _apart(rule, made[-1])):
            made[-1].append(rule)
        else:
            made.append([rule])
    return [group for made in groups.values() for group in made]


def _apart(rule: Rule, others: Iterable[Rule]) -> bool:
    """Whether a rule has no skill in common with the others."""
    return bool(rule.skills) and all(each.skills and not set(each.skills) & set(rule.skills) for each in others)


def _permitted(rules: Iterable[Rule], skills: int) -> list[int]:
    permits = [rule for rule in rules if rule.kind == RuleKind.PERMIT]
    return sorted({skill for rule in permits for skill in rule.skills or range(skills)})


class _ItemBuilder:
    """Makes items and finds their impossible goals."""

    def __init__(self, prepared: PreparedPolicy) -> None:
        self._prepared = prepared
        self._questions = Questions(prepared)

    def rule(self, group: Sequence[Rule]) -> CoverageItem:
        """The item of a rule, from all its flat forms."""
        first = group[0]
        every = range(len(self._prepared.policy.contracts))
        cases = [(skill, node) for rule in group for skill in rule.skills or every for node in [self._when(rule)]]
        possible = {
            goal
            for truth, goal in TRUTHS.items()
            if any((truth == TRUE) if node is None else self._possible(skill, node, truth) for skill, node in cases)
        }
        decides = {Goal.TRUE} if first.kind == RuleKind.PERMIT else {Goal.TRUE, Goal.UNKNOWN}
        where = Where(first.source, first.start, first.end)
        return _coverage_item(RuleKind(first.kind).name.lower(), "", first.text, where, possible, decides)

    def clause(self, skill: int, role: str, clause: Clause) -> CoverageItem:
        """The item of a clause of a skill.

        A `maintain` clause can always be false: over a planned volume, a comparison of sums may be false although it
        holds at every place of the volume.
        """
        contract = self._prepared.policy.contracts[skill]
        node = self._prepared.compiler.node(clause, contract)
        assumed = FALSE if role == "maintain" else 0
        possible = {goal for truth, goal in TRUTHS.items() if truth & assumed or self._possible(skill, node, truth)}
        where = Where(clause.source, clause.start, clause.end)
        return _coverage_item(role, contract.name, clause.text, where, possible, {Goal.FALSE, Goal.UNKNOWN})

    def energy(self, contract: Contract) -> CoverageItem:
        """The item of the charge that a skill needs. If it needs none, no charge is too low."""
        vehicle = self._prepared.policy.vehicle
        energy = Energy(contract, vehicle)
        possible = {Goal.TRUE, Goal.FALSE, Goal.UNKNOWN}
        if energy.needed(0, (vehicle.return_altitude, 0)) > FULL:
            possible.discard(Goal.TRUE)
        if not energy.stays and energy.needed(0) <= 0:
            possible.discard(Goal.FALSE)
        return _coverage_item(ENERGY, contract.name, ENERGY_TEXT, None, possible, {Goal.FALSE, Goal.UNKNOWN})

    def _when(self, rule: Rule) -> tree.Node | None:
        return self._prepared.compiler.when(rule)

    def _possible(self, skill: int, node: tree.Node, truth: Truth) -> bool:
        """Whether a condition may have a truth in some situation of a skill; False only if that is proved impossible.

        A condition on the time can be unknown only if the clock has an error.
        """
        space = self._questions.space(skill)
        if truth == UNKNOWN:
            space = space._replace(error=(0, _CLOCK_ERROR))
        return not isinstance(self._questions.ask((skill, node, truth), lambda: [(node, truth)], space), No)


def _airspace(airspace: Airspace) -> CoverageItem:
    possible = {Goal.TRUE, Goal.FALSE, Goal.UNKNOWN}
    where = Where(airspace.source, airspace.start, airspace.end)
    return _coverage_item(AIRSPACE, "", airspace.text, where, possible, {Goal.FALSE, Goal.UNKNOWN})


def _coverage_item(
    role: str, skill: str, text: str, where: Where | None, possible: set[Goal], decides: set[Goal]
) -> CoverageItem:
    """Make an item, which can decide if it can have one of the truths `decides`."""
    if possible & decides:
        possible = possible | {Goal.DECIDED}
    every = (Goal.TRUE, Goal.FALSE, Goal.UNKNOWN, Goal.DECIDED)
    goals = tuple(goal for goal in every if goal in possible)
    impossible = tuple(goal for goal in every if goal not in possible)
    return CoverageItem(role, skill, " ".join(text.split()), where, goals, impossible)
