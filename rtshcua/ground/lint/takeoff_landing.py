"""Rules that keep the vehicle on the ground (E1313) or in the air (E1312).

E1313: a rule or a contract that prevents every take-off, because it reads a signal that no autopilot knows on the
ground. Both autopilots estimate the wind only in the air (docs/flying/vehicles.md). A `forbid`, `confirm` or `degrade`
whose condition is then unknown defers the take-off until its deadline has passed, and so does an `assume` or `require`
of the climbing skill; a `permit` that is unknown permits nothing. Reported where it is proved that no truth of the
condition lets the take-off through while the vehicle stands on the ground without such a reading.

E1312: a `degrade` that covers a skill that lands, and whose target does not land there. `degrade any` covers every
skill, also one that a person requests to land at once: the request becomes a flight home. Whoever requests a landing
has often seen what no signal reports.
"""

from collections.abc import Iterator

from rtshcua.decision.tree import Node, slots_read
from rtshcua.decision.values import AND, FALSE, MISSING, NOT, TRUE, UNKNOWN, Truth
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.diagnostics.span import Span
from rtshcua.ground.analysis.box import clipped, present
from rtshcua.ground.analysis.solve import No
from rtshcua.ground.analysis.space import SituationSpace
from rtshcua.ground.lint.lint_input import LintInput, rules_of
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.ruleset import Ruleset
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.policy import MonitorKind, Policy, RuleKind
from rtshcua.model.flat.signal import Signal
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.policies import RuleDecl

#: messages that both autopilots fill only in the air
_AIRBORNE_MESSAGES = frozenset({"WIND_COV", "WIND"})
#: how far from its home height a vehicle may read itself on the ground, mm
_ON_THE_GROUND = 2_000
#: the truths of its condition with which a rule lets a take-off through; FALSE for the other kinds
_LETS_THROUGH: dict[int, Truth] = {RuleKind.PERMIT: TRUE, RuleKind.CONFIRM: FALSE | TRUE}


def rules_that_keep_grounded(subject: LintInput) -> Iterator[Diagnostic]:
    """Report the rules and clauses that keep every take-off on the ground (E1313)."""
    for ground in subject.lowered():
        policy = ground.prepared.policy
        signals = tuple(each for each in policy.signals if _unknown_on_the_ground(each))
        climbing = [number for number, each in enumerate(policy.contracts) if each.motion.kind == MotionKind.CLIMB]
        rules = Ruleset(ground)
        told: set[Span] = set()
        for skill in climbing if signals else ():
            for found in _for_skill(ground, rules, skill, signals):
                if found.span is not None and found.span not in told:
                    told.add(found.span)
                    yield found


def _unknown_on_the_ground(signal: Signal) -> bool:
    return all(each.message in _AIRBORNE_MESSAGES for each in signal.sources)


def _for_skill(ground: ProofContext, rules: Ruleset, skill: int, signals: tuple[Signal, ...]) -> Iterator[Diagnostic]:
    policy = ground.prepared.policy
    contract, slots = policy.contracts[skill], {each.slot for each in signals}
    space = _with_monitors(ground, skill, _standing_space(policy, rules.space(skill), slots))

    def stuck(clause: Clause | None, node: Node, lets: Truth) -> bool:
        """Whether a condition reads such a signal, and has no truth that lets the take-off through."""
        if clause is None or slots.isdisjoint(slots_read([clause], policy.vehicle, policy.monitors)):
            return False
        key = ("standing", skill, clause.code, lets)
        return isinstance(ground.questions.ask(key, lambda: [(node, lets)], space), No)

    about = [number for number in range(len(policy.rules)) if skill in rules.skills(number)]
    permits = {number for number in about if rules.rule(number).kind == RuleKind.PERMIT}
    kept = {
        number
        for number in about
        if stuck(rules.rule(number).when, rules.node(number), _LETS_THROUGH.get(rules.rule(number).kind, FALSE))
    }
    if not permits <= kept:  # one of them may permit it
        kept -= permits
    for number in sorted(kept):
        group = rules.groups[rules.group_of(number)]
        yield _keeps_grounded(group.span, contract.name, f"this `{group.declared.kind}`", signals)
    for clause in (*contract.require, *contract.assume):
        if stuck(clause, ground.prepared.compiler.node(clause, contract), TRUE):
            yield _keeps_grounded(ground.span(clause), contract.name, "this", signals)


def _standing_space(policy: Policy, space: SituationSpace, unknown: set[int]) -> SituationSpace:
    """The situations of a space in which the vehicle stands on the ground, and all but some signals are known."""
    slots = [MISSING if slot in unknown else present(value) for slot, value in enumerate(space.slots)]
    height = policy.vehicle.height
    if height >= 0:
        slots[height] = clipped(slots[height], -_ON_THE_GROUND, _ON_THE_GROUND) or slots[height]
    return space._replace(slots=tuple(slots))


def _with_monitors(ground: ProofContext, skill: int, space: SituationSpace) -> SituationSpace:
    """The same, with what conditions over time may say there. What one says of a window is what its condition was at
    some moment of it, or UNKNOWN; one that rises or falls was UNKNOWN, or what it may be, at the observation before.
    """
    prepared = ground.prepared
    for number, monitor in enumerate(prepared.policy.monitors):
        node = prepared.compiler.monitor_node(monitor, number)
        now = sum(truth for truth in (FALSE, TRUE, UNKNOWN) if _can_be(ground, (skill, number), node, truth, space))
        says = before = now | UNKNOWN
        if monitor.kind == MonitorKind.RISING:
            says = AND[NOT[before]][now]
        elif monitor.kind == MonitorKind.FALLING:
            says = AND[before][NOT[now]]
        space = space._replace(monitors=(*space.monitors[:number], says, *space.monitors[number + 1 :]))
    return space


def _can_be(ground: ProofContext, of: tuple[int, int], node: Node, truth: Truth, space: SituationSpace) -> bool:
    """Whether what a monitor looks at may have a truth there; `of`: about which skill, and the monitor's number."""
    return not isinstance(ground.questions.ask(("looked at", *of, truth), lambda: [(node, truth)], space), No)


def _keeps_grounded(span: Span, skill: str, what: str, signals: tuple[Signal, ...]) -> Diagnostic:
    names = ", ".join(f"`{each.name}`" for each in signals)
    return Diagnostic(
        codes.NEVER_TAKES_OFF,
        f"{what} keeps `{skill}` on the ground for ever: {names} is not known before the vehicle flies",
        span,
        f"leave `{skill}` out of it, or write the condition of a `degrade` of the skills that fly on",
    )


_LAND = "land"


def degrades_that_keep_up(subject: LintInput) -> Iterator[Diagnostic]:
    """Report degrade rules that keep a skill from landing (E1312)."""
    for unit in subject.asked:
        for rule in rules_of(unit):
            if rule.kind == "degrade" and rule.target is not None and not _lands(subject, rule.target.skill.text):
                yield from _skills_kept_up(subject, rule, rule.target.skill.text)


def _lands(subject: LintInput, name: str) -> bool:
    skill = subject.symbols.skills.get(name)
    return skill is not None and skill.motion is not None and skill.motion.kind == _LAND


def _skills_kept_up(subject: LintInput, rule: RuleDecl, target: str) -> Iterator[Diagnostic]:
    landing = [name for name in subject.symbols.skills if _lands(subject, name)]
    if not rule.skills and landing:
        help = "name the skills that you mean, and leave out those that land"
        yield _kept_from_landing(subject, rule, target, landing[0], help)
    for name in rule.skills:
        if name.text in landing:
            yield _kept_from_landing(
                subject, rule, target, name.text, f"leave `{name.text}` out, or degrade it to what lands", name
            )


def _kept_from_landing(
    subject: LintInput, rule: RuleDecl, target: str, landing: str, help: str, name: Name | None = None
) -> Diagnostic:
    motion = subject.symbols.skills[landing].motion
    assert motion is not None
    return Diagnostic(
        codes.KEPT_FROM_LANDING,
        f"whoever asks for `{landing}` under this condition gets `{target}`, which does not land on the spot",
        rule.span if name is None else name.span,
        help,
        (Label(motion.span, f"`{landing}` lands here and now"),),
    )
