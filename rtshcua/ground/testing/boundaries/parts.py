"""The conditions that bear on one invocation, each with its tree, and how to ask for its truth in a scene."""

from collections.abc import Iterator
from typing import NamedTuple

from rtshcua.decision import tree
from rtshcua.decision.evaluate import Condition, build
from rtshcua.decision.prepare import PreparedAirspace, PreparedInvocation
from rtshcua.decision.situation import ranging
from rtshcua.decision.values import EVERYWHERE, Truth
from rtshcua.ground.testing.boundaries.scene import Scene
from rtshcua.ground.testing.coverage.universe import AIRSPACE, ENERGY, ENERGY_TEXT, clauses_of
from rtshcua.model.decision import Decisive
from rtshcua.model.flat.policy import Rule

#: the clauses that hold for a planned volume, not for the present place alone
MAINTAIN = "maintain"


class Part(NamedTuple):
    """A condition: the word for its role, its clause, and its tree; airspace and energy have none."""

    role: str
    clause: Decisive
    node: tree.Node | None = None
    condition: Condition | None = None
    airspace: PreparedAirspace | None = None

    @property
    def text(self) -> str:
        """As it is written."""
        return ENERGY_TEXT if self.clause is None else " ".join(self.clause.text.split())


def parts(invocation: PreparedInvocation) -> Iterator[Part]:
    """Everything that may decide on an invocation, in the order of design 4.1; rules without a condition have no limit
    and are left out.
    """
    policy, candidates = invocation.policy, invocation.candidates
    for role, rules in (
        ("forbid", candidates.forbids),
        ("permit", candidates.permits),
        ("confirm", candidates.confirms),
    ):
        for rule in rules:
            yield from _rule(role, rule.rule, rule.condition, policy.compiler.when(rule.rule))
    contract = invocation.invocation.contract
    for role, clause in clauses_of(contract):
        node = policy.compiler.node(clause, contract)
        yield Part(role, clause, node, build(node, policy.tables))
    if policy.airspace is not None:
        yield Part(AIRSPACE, policy.airspace.airspace, airspace=policy.airspace)
    yield Part(ENERGY, None)
    for degrade in candidates.degrades:
        yield from _rule("degrade", degrade.rule, degrade.condition, policy.compiler.when(degrade.rule))


def _rule(role: str, rule: Rule, condition: Condition, node: tree.Node | None) -> Iterator[Part]:
    if node is not None:
        yield Part(role, rule, node, condition)


def questions(part: Part, invocation: PreparedInvocation) -> Iterator[tuple[tree.Atom | None, Part]]:
    """What a part is made of, each a part of its own: the atoms of its condition, the zones of an airspace; of the
    charge there is but one.
    """
    if part.node is not None:
        for atom in atoms(part.node):
            yield atom, part._replace(node=atom, condition=build(atom, invocation.policy.tables))
    elif part.airspace is not None:
        for zone in part.airspace.inside:
            yield None, part._replace(airspace=part.airspace._replace(inside=(zone,), outside=()))
        for zone in part.airspace.outside:
            yield None, part._replace(airspace=part.airspace._replace(inside=(), outside=(zone,)))
    else:
        yield None, part


def airspace_tree(part: Part) -> tuple[Part, tuple[tree.Atom, ...]]:
    """An airspace as a condition on the vehicle's place, as the analysis has it, and its zones as in `questions`."""
    assert part.airspace is not None
    inside = [tree.Inside(zone.number) for zone in part.airspace.inside]
    outside = [tree.Inside(zone.number) for zone in part.airspace.outside]
    nodes: list[tree.Node] = [*inside, *(tree.Not(zone) for zone in outside)]
    whole = nodes[0]
    for node in nodes[1:]:
        whole = tree.Both(whole, node)
    return part._replace(node=whole), (*inside, *outside)


def atoms(node: tree.Node) -> Iterator[tree.Atom]:
    """The atoms of a condition, from left to right."""
    match node:
        case tree.Both(left, right) | tree.Either(left, right):
            yield from atoms(left)
            yield from atoms(right)
        case tree.Not(operand):
            yield from atoms(operand)
        case _:
            yield node


def truth(part: Part, scene: Scene) -> Truth:
    """The truth of a part, as the step that asks for it has it."""
    invocation, at = scene.invocation, scene.environment()
    policy = invocation.policy
    known = policy.tables.known
    if part.condition is not None and part.role != MAINTAIN:
        return part.condition(at)
    volume = invocation.planner.volume(at.slots, known)
    if part.condition is not None:
        return EVERYWHERE[part.condition(ranging(at, volume, known.height, invocation.lasts_us))]
    if part.airspace is not None:
        return EVERYWHERE[part.airspace.keeps(volume.place, at, invocation.lasts_us)]
    return EVERYWHERE[invocation.energy.suffices(at.slots[known.battery], volume, at.slots[known.drain])]
