"""What all proofs ask: a policy as on board, with all arguments of a step and nothing of the vehicle's state known."""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field

from rtshcua.decision import tree
from rtshcua.decision.evaluate import Condition, Environment, build
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy, prepare_invocation
from rtshcua.decision.situation import environment
from rtshcua.decision.tree import Node, where
from rtshcua.decision.values import MISSING, Sets, Value
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.span import Span as Where
from rtshcua.ground.analysis.condition_trees import ALWAYS, NEVER, replace_atoms
from rtshcua.ground.analysis.solve import Questions
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.report import Report
from rtshcua.ground.lower.policy import LoweredPolicy
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Contract, Link
from rtshcua.model.flat.limits import WEEK
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Airspace, Policy, Rule, Speeds
from rtshcua.model.ir.skills import SkillDecl


def optimistic(node: tree.Node, hope: bool, fixed: frozenset[int] | None = None) -> tree.Node:
    """A condition whose atoms about the state are what brings it nearest to `hope`.

    Arguments, the time and the phase are known. `fixed` are slots of the state that are known too, and with them the
    place: None where nothing of the state is.
    """
    slots = fixed or frozenset()

    def best(atom: tree.Atom, hope: bool) -> tree.Node:
        match atom:
            case tree.AtMost(terms, _) | tree.Equal(terms, _):
                known = all(term.argument or term.at in slots for term in terms)
            case tree.Member(argument, index, _):
                known = argument or index in slots
            case tree.SlotKnown(index):
                known = index in slots
            case tree.InsideZone() | tree.InsideArgument():
                known = fixed is not None
            case _:
                known = not isinstance(atom, tree.MonitorSays)
        return atom if known else ALWAYS if hope else NEVER

    return replace_atoms(node, best, hope)


#: us since the epoch: later than any flight
EVER = 1 << 53


@dataclass(frozen=True, slots=True)
class ProofContext:
    """A lowered policy, prepared as on board, and any state that its vehicle may be in; `questions` are asked of it.

    `kept` are the ways that were found to keep its airspace (`ways`): the missions of one policy share many.
    `steps` are those that were prepared, `hopes` the conditions of rules as `optimistic` has them: the choices of a
    mission's parameters share many.
    `nodes` and `conditions` are those of its rules, by their code.
    `bests` are the clauses of contracts in the best of all states.
    `impossible` are the skills whose contracts were reported to contradict themselves: no step of one is looked at.
    """

    context: CheckContext
    lowered: LoweredPolicy
    prepared: PreparedPolicy
    anything: tuple[Value, ...]
    questions: Questions
    kept: set[tuple[object, ...]] = field(default_factory=set)
    steps: dict[tuple[Invocation, tuple[str, ...]], PreparedInvocation | Refusal] = field(default_factory=dict)
    hopes: dict[Hashable, Node | None] = field(default_factory=dict)
    bests: dict[tuple[int, ...], Condition] = field(default_factory=dict)
    impossible: set[int] = field(default_factory=set)
    nodes: dict[tuple[int, ...], Node] = field(default_factory=dict)
    conditions: dict[tuple[int, ...], Condition] = field(default_factory=dict)

    @property
    def report(self) -> Report:
        """Where findings go."""
        return self.context.report

    @property
    def policy(self) -> Policy:
        """The lowered policy."""
        return self.prepared.policy

    @property
    def speeds(self) -> Speeds:
        """How fast the vehicle flies; the compiler writes them."""
        speeds = self.policy.vehicle.speeds
        assert speeds is not None
        return speeds

    @property
    def skills(self) -> Mapping[str, SkillDecl]:
        """The skills as they are declared, by name."""
        return self.context.symbols.skills

    def node(self, rule: Rule) -> Node:
        """The condition of a rule as a tree; rules share those that are alike."""
        code = () if rule.when is None else rule.when.code
        found = self.nodes.get(code)
        if found is None:
            when = self.prepared.compiler.when(rule)
            found = self.nodes[code] = ALWAYS if when is None else when
        return found

    def condition(self, rule: Rule) -> Condition:
        """The condition of a rule, to be evaluated; rules share those that are alike."""
        code = () if rule.when is None else rule.when.code
        found = self.conditions.get(code)
        if found is None:
            found = self.conditions[code] = build(self.node(rule), self.prepared.tables)
        return found

    def best(self, clause: Clause, contract: Contract) -> Condition:
        """A clause, in the best of all states that the place, the height, the time and the arguments leave open."""
        found = self.bests.get(clause.code)
        if found is None:
            fixed = frozenset(where(self.prepared.policy.vehicle))
            node = optimistic(self.prepared.compiler.node(clause, contract), True, fixed)
            found = self.bests[clause.code] = build(node, self.prepared.tables)
        return found

    def sets(self, at_us: int = 0) -> Sets:
        """Any state, at any time within a week from a UTC time; at any time at all where that is not known (0)."""
        return Sets(self.anything, (0, 0), ((at_us, at_us + WEEK - 1 if at_us else EVER),), (0, 0))

    def prepare(self, invocation: Invocation, phases: tuple[str, ...]) -> PreparedInvocation | Refusal:
        """A step of a mission with these phases, prepared as on board, or what is wrong with it."""
        found = self.steps.get((invocation, phases))
        if found is None:
            found = self.steps[invocation, phases] = prepare_invocation(invocation, self.prepared, phases)
        return found

    def around(self, invocation: PreparedInvocation) -> Environment:
        """Any state around a step, for a condition."""
        sets = self.sets(invocation.invocation.issued_at_us)
        return environment(sets, self.prepared, invocation.arguments, invocation.phase)

    def environment(self, arguments: tuple[Value, ...], phase: int) -> Environment:
        """Arguments in any state, in a phase by its number among the policy's names, for a condition."""
        sets = self.sets()
        return Environment((*sets.values, MISSING), arguments, sets.utc_us, sets.utc_error_us, phase=phase)

    def span(self, part: Clause | Rule | Link | Airspace) -> Where:
        """Where a part of the policy is written."""
        return self.lowered.files.span(part.source, part.start, part.end)
