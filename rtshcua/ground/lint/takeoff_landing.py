"""Rules that prevent every take-off (E1313) or replace a landing by a flight (E1312).

E1313: a rule or a contract prevents every take-off because it reads a signal that no autopilot reports on the ground.
Both autopilots estimate the wind only in the air (docs/flying/vehicles.md). A `forbid`, `confirm` or `degrade` whose
condition is unknown defers the take-off until its deadline has passed, and so does an `assume` or `require` of the
climbing skill. A `permit` whose condition is unknown permits nothing. A finding means: it is proved that the condition
never has a truth value that allows the take-off while the vehicle stands on the ground without such a reading.

E1312: a `degrade` rule applies to a skill that lands, and its target does not land on the spot. `degrade any` applies
to every skill. If a person requests an immediate landing, the vehicle flies home instead, although the person may have
seen a danger that no signal reports.
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
#: largest error of the measured height while the vehicle stands on the ground, mm
_ON_THE_GROUND = 2_000
#: by kind of rule, the truth values of its condition that allow a take-off; FALSE for other kinds
_ALLOWING: dict[int, Truth] = {RuleKind.PERMIT: TRUE, RuleKind.CONFIRM: FALSE | TRUE}


def rules_that_keep_grounded(subject: LintInput) -> Iterator[Diagnostic]:
    """Report the rules and clauses that prevent every take-off (E1313)."""
    for ground in subject.lowered():
        policy = ground.prepared.policy
        signals = tuple(each for each in policy.signals if _unknown_on_the_ground(each))
        climbing = [number for number, each in enumerate(policy.contracts) if each.motion.kind == MotionKind.CLIMB]
        rules = Ruleset(ground)
        reported: set[Span] = set()
        for skill in climbing if signals else ():
            for found in _for_skill(ground, rules, skill, signals):
                if found.span is not None and found.span not in reported:
                    reported.add(found.span)
                    yield found


def _unknown_on_the_ground(signal: Signal) -> bool:
    return all(each.message in _AIRBORNE_MESSAGES for each in signal.sources)


def _for_skill(ground: ProofContext, rules: Ruleset, skill: int, signals: tuple[Signal, ...]) -> Iterator[Diagnostic]:
    policy = ground.prepared.policy
    contract, slots = policy.contracts[skill], {each.slot for each in signals}
    space = _with_monitors(ground, skill, _standing_space(policy, rules.space(skill), slots))

    def prevents(clause: Clause | None, node: Node, allowing: Truth) -> bool:
        """Whether a condition reads such a signal, and never has a truth value that allows the take-off."""
        if clause is None or slots.isdisjoint(slots_read([clause], policy.vehicle, policy.monitors)):
            return False
        key = ("standing", skill, clause.code, allowing)
        return isinstance(ground.questions.ask(key, lambda: [(node, allowing)], space), No)

    about = [number for number in range(len(policy.rules)) if skill in rules.skills(number)]
    permits = {number for number in about if rules.rule(number).kind == RuleKind.PERMIT}
    preventing = {
        number
        for number in about
        if prevents(rules.rule(number).when, rules.node(number), _ALLOWING.get(rules.rule(number).kind, FALSE))
    }
    if not permits <= preventing:  # another permit may allow the take-off
        preventing -= permits
    for number in sorted(preventing):
        group = rules.groups[rules.group_of(number)]
        yield _keeps_grounded(group.span, contract.name, f"this `{group.declared.kind}`", signals)
    for clause in (*contract.require, *contract.assume):
        if prevents(clause, ground.prepared.compiler.node(clause, contract), TRUE):
            yield _keeps_grounded(ground.span(clause), contract.name, "this clause", signals)


def _standing_space(policy: Policy, space: SituationSpace, unknown: set[int]) -> SituationSpace:
    """Restrict a space to a vehicle on the ground, with all slots known except the `unknown` ones."""
    slots = [MISSING if slot in unknown else present(value) for slot, value in enumerate(space.slots)]
    height = policy.vehicle.height
    if height >= 0:
        slots[height] = clipped(slots[height], -_ON_THE_GROUND, _ON_THE_GROUND) or slots[height]
    return space._replace(slots=tuple(slots))


def _with_monitors(ground: ProofContext, skill: int, space: SituationSpace) -> SituationSpace:
    """Return the space with the possible truth values of the monitors.

    A monitor over a window has a value that its condition had in the window, or UNKNOWN. A monitor of a rising or
    falling condition compares the condition with its previous value, which may also be UNKNOWN.
    """
    prepared = ground.prepared
    for number, monitor in enumerate(prepared.policy.monitors):
        node = prepared.compiler.monitor_node(monitor, number)
        now = sum(truth for truth in (FALSE, TRUE, UNKNOWN) if _can_be(ground, (skill, number), node, truth, space))
        possible = before = now | UNKNOWN
        if monitor.kind == MonitorKind.RISING:
            possible = AND[NOT[before]][now]
        elif monitor.kind == MonitorKind.FALLING:
            possible = AND[before][NOT[now]]
        space = space._replace(monitors=(*space.monitors[:number], possible, *space.monitors[number + 1 :]))
    return space


def _can_be(ground: ProofContext, of: tuple[int, int], node: Node, truth: Truth, space: SituationSpace) -> bool:
    """Whether the condition of a monitor may have a truth value in a space; `of` is the skill and the monitor."""
    return not isinstance(ground.questions.ask(("looked at", *of, truth), lambda: [(node, truth)], space), No)


def _keeps_grounded(span: Span, skill: str, subject: str, signals: tuple[Signal, ...]) -> Diagnostic:
    names = ", ".join(f"`{each.name}`" for each in signals)
    return Diagnostic(
        codes.NEVER_TAKES_OFF,
        f"{subject} prevents every `{skill}`: {names} is unknown until the vehicle flies",
        span,
        f"exclude `{skill}`, or move the condition to a `degrade` of the skills that fly afterwards",
    )


_LAND = "land"


def degrades_that_keep_up(subject: LintInput) -> Iterator[Diagnostic]:
    """Report `degrade` rules that replace a landing by a flight (E1312)."""
    for unit in subject.requested:
        for rule in rules_of(unit):
            if rule.kind == "degrade" and rule.target is not None and not _lands(subject, rule.target.skill.text):
                yield from _skills_kept_up(subject, rule, rule.target.skill.text)


def _lands(subject: LintInput, name: str) -> bool:
    skill = subject.symbols.skills.get(name)
    return skill is not None and skill.motion is not None and skill.motion.kind == _LAND


def _skills_kept_up(subject: LintInput, rule: RuleDecl, target: str) -> Iterator[Diagnostic]:
    landing = [name for name in subject.symbols.skills if _lands(subject, name)]
    if not rule.skills and landing:
        help = "name the skills to degrade, without those that land"
        yield _kept_from_landing(subject, rule, target, landing[0], help)
    for name in rule.skills:
        if name.text in landing:
            help = f"remove `{name.text}`, or degrade it to a skill that lands on the spot"
            yield _kept_from_landing(subject, rule, target, name.text, help, name)


def _kept_from_landing(
    subject: LintInput, rule: RuleDecl, target: str, landing: str, help: str, name: Name | None = None
) -> Diagnostic:
    motion = subject.symbols.skills[landing].motion
    assert motion is not None
    return Diagnostic(
        codes.KEPT_FROM_LANDING,
        f"under this condition, `{target}` replaces `{landing}`, but does not land on the spot",
        rule.span if name is None else name.span,
        help,
        (Label(motion.span, f"`{landing}` lands on the spot"),),
    )
