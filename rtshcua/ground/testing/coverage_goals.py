"""What there is to cover of a policy: its clauses, and of each the outcomes that it can have.

Clauses are the rules as they are after elaboration (of templates and delegations, each shown as it is written, behind
the `use` or the `delegate` that made it), the airspace, and of each skill that a rule permits its `require`, `assume`
and `maintain` clauses and the charge that it needs. One more line stands for the outcomes of the policy's decisions.

An outcome is left out where it is shown to be impossible, by the analysis that the compiler's proofs use. What is not
shown impossible counts, even if nothing can bring it about.
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
    """What can be reached of a clause: a truth, or that it decided. Of a policy's decisions: an outcome."""

    TRUE = "true"
    FALSE = "false"
    UNKNOWN = "unknown"
    DECIDED = "decided"
    ALLOW = "allow"
    DENY = "deny"
    DEFER = "defer"
    FALLBACK = "fallback"


#: the goal that stands for a truth, and for an outcome
TRUTHS: dict[Truth, Goal] = {TRUE: Goal.TRUE, FALSE: Goal.FALSE, UNKNOWN: Goal.UNKNOWN}
OUTCOMES: dict[Outcome, Goal] = {outcome: Goal(outcome.name.lower()) for outcome in Outcome}

#: the roles of clauses of a skill, besides the words of its lists
ENERGY, AIRSPACE, DECISIONS = "energy", "airspace", "outcomes"
#: us: how wrong a clock may be, where that makes the time unknown
_CLOCK_ERROR = 1_000_000
ENERGY_TEXT = "the charge to finish, to come home, and the reserve"


class Where(NamedTuple):
    """Where a clause is written: an index into the policy's `sources`, and character offsets."""

    source: int
    start: int
    end: int


class CoverageItem(NamedTuple):
    """One clause. `skill` is the name of the skill that it belongs to, "" for what is the policy's own.

    `goals` are what counts, in the order of `Goal`; `impossible` what was shown to be out of reach.
    """

    role: str
    skill: str
    text: str
    where: Where | None
    goals: tuple[Goal, ...]
    impossible: tuple[Goal, ...]


class Universe(NamedTuple):
    """All items of a policy, in the order of its text, and where to find each: rules by themselves, the clauses of
    skills by the skill's number.
    """

    prepared: PreparedPolicy
    items: tuple[CoverageItem, ...]
    rules: dict[Rule, int]
    clauses: dict[tuple[int, str, Clause], int]
    energy: dict[int, int]
    airspace: int | None
    decisions: int

    @property
    def total(self) -> int:
        """How many goals there are."""
        return sum(len(item.goals) for item in self.items)


def universe_of(prepared: PreparedPolicy) -> Universe:
    """What there is to cover of a policy."""
    policy, made = prepared.policy, _Made(prepared)
    items: list[CoverageItem] = []
    rules: dict[Rule, int] = {}
    for group in _written(policy.rules):
        rules |= dict.fromkeys(group, len(items))
        items.append(made.rule(group))
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
            items.append(made.clause(skill, role, clause))
        energy[skill] = len(items)
        items.append(made.energy(contract))
    decisions = len(items)
    items.append(CoverageItem(DECISIONS, "", "the outcomes of its decisions", None, tuple(OUTCOMES.values()), ()))
    return Universe(prepared, tuple(items), rules, clauses, energy, airspace, decisions)


def clauses_of(contract: Contract) -> Iterator[tuple[str, Clause]]:
    """The conditions of a contract, each with the word of its list."""
    for role, clauses in (("require", contract.require), ("assume", contract.assume), ("maintain", contract.maintain)):
        for clause in clauses:
            yield role, clause


def _written(rules: Iterable[Rule]) -> Iterable[list[Rule]]:
    """The rules as a person wrote them: one over skills that keep their arguments in different cells became several.

    Where the text was cut, what differs may stand behind that: only what no skill has in common is one rule then.
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
    """Whether a rule is about none of the skills that others are about."""
    return bool(rule.skills) and all(each.skills and not set(each.skills) & set(rule.skills) for each in others)


def _permitted(rules: Iterable[Rule], skills: int) -> list[int]:
    permits = [rule for rule in rules if rule.kind == RuleKind.PERMIT]
    return sorted({skill for rule in permits for skill in rule.skills or range(skills)})


class _Made:
    """Makes items, and asks what is impossible; how the zones lie is found out once."""

    def __init__(self, prepared: PreparedPolicy) -> None:
        self._prepared = prepared
        self._questions = Questions(prepared)

    def rule(self, group: Sequence[Rule]) -> CoverageItem:
        """One rule, in all its flat forms."""
        first = group[0]
        every = range(len(self._prepared.policy.contracts))
        asked = [(skill, node) for rule in group for skill in rule.skills or every for node in [self._when(rule)]]
        possible = {
            goal
            for truth, goal in TRUTHS.items()
            if any((truth == TRUE) if node is None else self._possible(skill, node, truth) for skill, node in asked)
        }
        decides = {Goal.TRUE} if first.kind == RuleKind.PERMIT else {Goal.TRUE, Goal.UNKNOWN}
        where = Where(first.source, first.start, first.end)
        return _coverage_item(RuleKind(first.kind).name.lower(), "", first.text, where, possible, decides)

    def clause(self, skill: int, role: str, clause: Clause) -> CoverageItem:
        """A condition of a skill. Over a planned volume, a comparison of sums may be false where no place of it is, so
        that a `maintain` clause is never shown not to be false.
        """
        contract = self._prepared.policy.contracts[skill]
        node = self._prepared.compiler.node(clause, contract)
        assumed = FALSE if role == "maintain" else 0
        possible = {goal for truth, goal in TRUTHS.items() if truth & assumed or self._possible(skill, node, truth)}
        where = Where(clause.source, clause.start, clause.end)
        return _coverage_item(role, contract.name, clause.text, where, possible, {Goal.FALSE, Goal.UNKNOWN})

    def energy(self, contract: Contract) -> CoverageItem:
        """The charge that a skill needs: none is too little where it needs none."""
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
        """Whether a condition may have a truth in some situation of a skill; false only where it is proved not to. What
        asks for the time is unknown only where the clock may be wrong.
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
    """An item; it can decide where it can have one of the truths that decide."""
    if possible & decides:
        possible = possible | {Goal.DECIDED}
    every = (Goal.TRUE, Goal.FALSE, Goal.UNKNOWN, Goal.DECIDED)
    goals = tuple(goal for goal in every if goal in possible)
    impossible = tuple(goal for goal in every if goal not in possible)
    return CoverageItem(role, skill, " ".join(text.split()), where, goals, impossible)
