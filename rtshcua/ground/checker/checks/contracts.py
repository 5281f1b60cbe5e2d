"""E0606, E0608 to E0610: a skill's contract is complete, and its motion names parameters of the right types."""

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.conditions import check_condition
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.fields import one_of, quantity
from rtshcua.ground.checker.symbols import suggestion
from rtshcua.ground.checker.types import DURATION, HEIGHT, POSITION, SPEED, ZONE, Kind, Type
from rtshcua.model.durability import WORDS as DURABILITIES
from rtshcua.model.flat.contract import TimingClass
from rtshcua.model.flat.limits import FULL
from rtshcua.model.ir.expression import Quantity
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.skills import Motion, SkillDecl
from rtshcua.model.quantity import Dimension

CLASSES = tuple(each.name.lower() for each in TimingClass)
#: kinds of evidence (paper symbol `ev`)
KINDS = ("intent", "decision", "state", "authorization", "effect")
#: what a `record` clause may name: what is recorded, and how durably
RECORDS = (*KINDS, *DURABILITIES)
#: survey patterns that a `cover` motion knows
PATTERNS = ("grid", "perimeter", "orbit")


def check_contracts(context: Context) -> None:
    """Report every contract that leaves open what the decision needs."""
    for skill in context.symbols.skills.values():
        _complete(context, skill)
        if skill.timing_class is not None:
            one_of(context, codes.UNKNOWN_CLASS, skill.timing_class, CLASSES, "timing class")
        for name in skill.record:
            one_of(context, codes.UNKNOWN_RECORD, name, RECORDS, "kind of evidence")
        for field in (skill.deadline, skill.validity, skill.duration):
            quantity(context, field, Dimension.DURATION)
        quantity(context, skill.grace, Dimension.DURATION, positive=False)
        quantity(context, skill.energy, Dimension.RATIO, positive=False)
        more_than_full(context, skill.energy, "skill")
        if skill.motion is not None:
            _motion(context, skill, skill.motion)
        scope = context.scope_of(skill)
        for clause in (*skill.require, *skill.assume, *skill.maintain):
            check_condition(scope, clause.condition)


def more_than_full(context: Context, energy: Quantity | None, what: str) -> None:
    """Report a share of the energy that no battery has."""
    if energy is not None and energy.dimension is Dimension.RATIO and energy.value > FULL:
        context.report.add(
            codes.BEYOND_VEHICLE,
            energy.span,
            f"the {what} may take `{context.report.text(energy.span)}`, and a full battery has 100 %",
            help="write what it takes at most, as a share of a full battery and with the reserve left over",
        )


def _complete(context: Context, skill: SkillDecl) -> None:
    """Everything that has no default which would be safe in silence; a landing needs nothing to fall back on."""
    kind = None if skill.motion is None else skill.motion.kind
    written = {
        "motion": skill.motion is not None,
        "class": skill.timing_class is not None,
        "deadline": skill.deadline is not None,
        "valid for": skill.validity is not None,
        "lasts at most": skill.duration is not None or kind == "hold",
        "energy at most": skill.energy is not None,
        "fallback": bool(skill.fallback) or kind == "land",
    }
    words = {"validity": "valid for", "duration": "lasts at most", "energy": "energy at most"}
    named = {words.get(each.part, each.part) for each in skill.sized}  # by a size that has no value, which is reported
    missing = [f"`{field}`" for field, present in written.items() if not present and field not in named]
    if missing:
        context.report.add(
            codes.INCOMPLETE_CONTRACT,
            skill.name.span,
            f"the contract of `{skill.name.text}` lacks " + ", ".join(missing),
            help="a decision needs these, and no default for them would be safe",
        )


def _motion(context: Context, skill: SkillDecl, motion: Motion) -> None:
    _parameter(context, skill, motion.altitude, HEIGHT)
    _parameter(context, skill, motion.speed, SPEED)
    _parameter(context, skill, motion.time, DURATION)
    _parameter(context, skill, motion.target, ZONE if motion.kind == "cover" else POSITION)
    if motion.kind == "fly" and motion.target is not None:
        first = next((p for p in skill.parameters if p.type.text == "position"), None)
        if first is not None and motion.target.text != first.name.text:
            context.report.add(
                codes.BAD_MOTION,
                motion.target.span,
                f"the vehicle flies to the first position of its parameters, which is `{first.name.text}`",
                labels=[(first.span, "declared here")],
            )
    if motion.pattern is not None:
        argument = context.arguments(skill).get(motion.pattern.text)
        if argument is None or argument.type.kind is not Kind.ENUMERATION:
            _not_parameter(context, skill, motion.pattern, "a choice among " + ", ".join(PATTERNS))
        else:
            for choice in argument.declaration.choices:
                one_of(context, codes.BAD_MOTION, choice, PATTERNS, "survey pattern")


def _parameter(context: Context, skill: SkillDecl, name: Name | None, type: Type) -> None:
    if name is None:
        return
    argument = context.arguments(skill).get(name.text)
    if argument is None or argument.type != type:
        _not_parameter(context, skill, name, type.describe())


def _not_parameter(context: Context, skill: SkillDecl, name: Name, asked: str) -> None:
    names = [parameter.name.text for parameter in skill.parameters]
    labels = [(p.span, f"`{name.text}` is declared here") for p in skill.parameters if p.name.text == name.text]
    context.report.add(
        codes.BAD_MOTION,
        name.span,
        f"`{name.text}` is no parameter of `{skill.name.text}` that is {asked}",
        help=None if labels else suggestion(name.text, names),
        labels=labels,
    )
