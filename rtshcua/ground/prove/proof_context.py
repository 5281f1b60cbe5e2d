"""The context of all proofs: a policy prepared as on board, in which only the arguments of a step are known."""

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
    """Replace the atoms of a condition that depend on the state by the value that favours `hope`.

    Arguments, the time and the phase are known. `fixed` are the known slots of the state; with them the place is known
    too. None means that nothing of the state is known.
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


#: a time later than any flight, us since the epoch
EVER = 1 << 53


@dataclass(frozen=True, slots=True)
class ProofContext:
    """A lowered policy, prepared as on board, with all states of its vehicle, and caches that its proofs share.

    `anything`: every value of each signal.
    `questions`: answers of the analysis.
    `kept`: ways proved to stay in the airspace (`fallback_ways`). The missions of one policy share many of them.
    `steps`: prepared steps. The instances of a mission share many of them.
    `hopes`: conditions of rules simplified by `optimistic`.
    `nodes`, `conditions`: conditions of rules by their code.
    `bests`: clauses of contracts in the best state.
    `impossible`: skills with contradictory contracts, which are reported. Their steps are not proved.
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
        """The report that collects findings."""
        return self.context.report

    @property
    def policy(self) -> Policy:
        """The lowered policy."""
        return self.prepared.policy

    @property
    def speeds(self) -> Speeds:
        """The speeds of the vehicle, which the compiler always sets."""
        speeds = self.policy.vehicle.speeds
        assert speeds is not None
        return speeds

    @property
    def skills(self) -> Mapping[str, SkillDecl]:
        """The declared skills by name."""
        return self.context.symbols.skills

    def node(self, rule: Rule) -> Node:
        """Return the condition of a rule as a tree, shared by rules with equal conditions."""
        code = () if rule.when is None else rule.when.code
        found = self.nodes.get(code)
        if found is None:
            when = self.prepared.compiler.when(rule)
            found = self.nodes[code] = ALWAYS if when is None else when
        return found

    def condition(self, rule: Rule) -> Condition:
        """Return the condition of a rule ready for evaluation, shared by rules with equal conditions."""
        code = () if rule.when is None else rule.when.code
        found = self.conditions.get(code)
        if found is None:
            found = self.conditions[code] = build(self.node(rule), self.prepared.tables)
        return found

    def best(self, clause: Clause, contract: Contract) -> Condition:
        """Return a clause in the best state for a given place, height, time and arguments."""
        found = self.bests.get(clause.code)
        if found is None:
            fixed = frozenset(where(self.prepared.policy.vehicle))
            node = optimistic(self.prepared.compiler.node(clause, contract), True, fixed)
            found = self.bests[clause.code] = build(node, self.prepared.tables)
        return found

    def sets(self, at_us: int = 0) -> Sets:
        """Return all states at all times within a week from a UTC time, or at all times if it is unknown (0)."""
        return Sets(self.anything, (0, 0), ((at_us, at_us + WEEK - 1 if at_us else EVER),), (0, 0))

    def prepare(self, invocation: Invocation, phases: tuple[str, ...]) -> PreparedInvocation | Refusal:
        """Prepare a step of a mission with these phases as on board. Returns the refusal if it is refused there."""
        found = self.steps.get((invocation, phases))
        if found is None:
            found = self.steps[invocation, phases] = prepare_invocation(invocation, self.prepared, phases)
        return found

    def around(self, invocation: PreparedInvocation) -> Environment:
        """Return all states in which a step may be decided, as the environment of a condition."""
        sets = self.sets(invocation.invocation.issued_at_us)
        return environment(sets, self.prepared, invocation.arguments, invocation.phase)

    def environment(self, arguments: tuple[Value, ...], phase: int) -> Environment:
        """Return arguments in all states, in a phase by its index in the policy, as the environment of a condition."""
        sets = self.sets()
        return Environment((*sets.values, MISSING), arguments, sets.utc_us, sets.utc_error_us, phase=phase)

    def span(self, part: Clause | Rule | Link | Airspace) -> Where:
        """Return the source span of a part of the policy."""
        return self.lowered.files.span(part.source, part.start, part.end)
