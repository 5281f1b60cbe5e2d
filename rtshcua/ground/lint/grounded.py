"""E1313: a rule or a contract by which nothing ever takes off: it reads what no autopilot knows on the ground.

Both autopilots estimate the wind only in the air (docs/flying/vehicles.md). A `forbid`, `confirm` or `degrade` whose
condition is then unknown defers the take-off until its deadline is over, and so does an `assume` or `require` of the
skill that climbs; a `permit` that is unknown permits nothing. Told where it is proved that the condition has no truth
that lets a take-off through while the vehicle stands on the ground and does not report such a signal, over time too.
"""

from collections.abc import Iterator

from rtshcua.decision.tree import Node, slots_read
from rtshcua.decision.values import AND, FALSE, MISSING, NOT, TRUE, UNKNOWN, Truth
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Span
from rtshcua.ground.analysis.box import clipped, present
from rtshcua.ground.analysis.solve import No
from rtshcua.ground.analysis.space import Space
from rtshcua.ground.lint.subject import Subject
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.ruleset import Ruleset
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.policy import MonitorKind, Policy, RuleKind
from rtshcua.model.flat.signal import Signal

#: messages that both autopilots fill only in the air
_IN_THE_AIR = frozenset({"WIND_COV", "WIND"})
#: how far from its home height a vehicle may read itself on the ground, mm
_ON_THE_GROUND = 2_000


def check(subject: Subject) -> Iterator[Diagnostic]:
    """Report what keeps every take-off on the ground."""
    for ground in subject.lowered():
        policy = ground.prepared.policy
        signals = tuple(each for each in policy.signals if _unknown_on_the_ground(each))
        climbing = [number for number, each in enumerate(policy.contracts) if each.motion.kind == MotionKind.CLIMB]
        rules = Ruleset(ground)
        told: set[Span] = set()
        for skill in climbing if signals else ():
            for found in _of(ground, rules, skill, signals):
                if found.span is not None and found.span not in told:
                    told.add(found.span)
                    yield found


def _unknown_on_the_ground(signal: Signal) -> bool:
    return all(each.message in _IN_THE_AIR for each in signal.sources)


def _of(ground: ProofContext, rules: Ruleset, skill: int, signals: tuple[Signal, ...]) -> Iterator[Diagnostic]:
    policy = ground.prepared.policy
    contract, slots = policy.contracts[skill], {each.slot for each in signals}
    space = _looked_at(ground, skill, _standing(policy, rules.space(skill), slots))

    def stuck(clause: Clause | None, node: Node, lets: Truth) -> bool:
        """Whether a condition reads such a signal, and has no truth that lets the take-off through."""
        if clause is None or slots.isdisjoint(slots_read([clause], policy.vehicle, policy.monitors)):
            return False
        key = ("standing", skill, clause.code, lets)
        return isinstance(ground.questions.ask(key, lambda: [(node, lets)], space), No)

    about = [number for number in range(len(policy.rules)) if skill in rules.skills(number)]
    permits = [number for number in about if rules.rule(number).kind == RuleKind.PERMIT]
    held = [number for number in about if number not in permits]
    lets: dict[int, Truth] = {RuleKind.CONFIRM: FALSE | TRUE}
    kept = [
        each for each in held if stuck(rules.rule(each).when, rules.node(each), lets.get(rules.rule(each).kind, FALSE))
    ]
    if permits and all(stuck(rules.rule(each).when, rules.node(each), TRUE) for each in permits):
        kept += permits
    for number in kept:
        group = rules.groups[rules.group_of(number)]
        yield _found(group.span, contract.name, f"this `{group.declared.kind}`", signals)
    for clause in (*contract.require, *contract.assume):
        if stuck(clause, ground.prepared.compiler.node(clause, contract), TRUE):
            yield _found(ground.span(clause), contract.name, "this", signals)


def _standing(policy: Policy, space: Space, unknown: set[int]) -> Space:
    """The situations of a space in which the vehicle stands on the ground, and all but some signals are known."""
    slots = [MISSING if slot in unknown else present(value) for slot, value in enumerate(space.slots)]
    height = policy.vehicle.height
    if height >= 0:
        slots[height] = clipped(slots[height], -_ON_THE_GROUND, _ON_THE_GROUND) or slots[height]
    return space._replace(slots=tuple(slots))


def _looked_at(ground: ProofContext, skill: int, space: Space) -> Space:
    """The same, with what conditions over time may say there. What one says of a window is what its condition was at
    some moment of it, or UNKNOWN; one that rises or falls was UNKNOWN, or what it may be, at the observation before.
    """
    prepared = ground.prepared
    for number, monitor in enumerate(prepared.policy.monitors):
        node = prepared.compiler.monitor_node(monitor, number)
        now = sum(truth for truth in (FALSE, TRUE, UNKNOWN) if _may_be(ground, (skill, number), node, truth, space))
        says = before = now | UNKNOWN
        if monitor.kind == MonitorKind.RISING:
            says = AND[NOT[before]][now]
        elif monitor.kind == MonitorKind.FALLING:
            says = AND[before][NOT[now]]
        space = space._replace(monitors=(*space.monitors[:number], says, *space.monitors[number + 1 :]))
    return space


def _may_be(ground: ProofContext, of: tuple[int, int], node: Node, truth: Truth, space: Space) -> bool:
    """Whether what a monitor looks at may have a truth there; `of`: about which skill, and the monitor's number."""
    return not isinstance(ground.questions.ask(("looked at", *of, truth), lambda: [(node, truth)], space), No)


def _found(span: Span, skill: str, what: str, signals: tuple[Signal, ...]) -> Diagnostic:
    names = ", ".join(f"`{each.name}`" for each in signals)
    return Diagnostic(
        codes.NEVER_TAKES_OFF,
        f"{what} keeps `{skill}` on the ground for ever: {names} is not known before the vehicle flies",
        span,
        f"leave `{skill}` out of it, or write the condition of a `degrade` of the skills that fly on",
    )
