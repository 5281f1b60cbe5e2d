"""Check skill contracts: completeness, motion parameters, fallback chains and records.

To verify a decision, an auditor needs the decision, every signal that it read, and the authority; intent and effect
record the reason and the result. A reflex has no authority to record: its step was authorised before, and its effect
shows the decision.

| class | must record |
|---|---|
| `semantic`, `tactical` | decision, state, authorization |
| `reflex` | decision, state, effect |

A skill that names no kind records all kinds. Only a reflex may have `buffered` records, which a crash of the process
loses (design section 6).
"""

from collections.abc import Sequence

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.suggest import listed
from rtshcua.ground.checker.chains import check_chain
from rtshcua.ground.checker.conditions import check_condition
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.fields import one_of, quantity
from rtshcua.ground.checker.symbols import suggestion
from rtshcua.ground.checker.types import DURATION, HEIGHT, LENGTH, POSITION, SPEED, ZONE, Kind, Type
from rtshcua.ground.geometry.levels import INWARD
from rtshcua.ground.geometry.survey import ALL_PATTERNS, DEFAULT_PATTERN, SIDEWAYS
from rtshcua.model.durability import BUFFERED, WORDS, WRITTEN
from rtshcua.model.durability import WORDS as DURABILITIES
from rtshcua.model.flat.contract import TimingClass
from rtshcua.model.flat.limits import FULL
from rtshcua.model.ir.expression import Quantity
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.skills import MotionDecl, SkillDecl
from rtshcua.model.quantity import Dimension

CLASSES = tuple(each.name.lower() for each in TimingClass)
#: kinds of evidence (paper symbol `ev`)
KINDS = ("intent", "decision", "state", "authorization", "effect")
#: the words of a `record` clause: kinds of evidence and durabilities
RECORDS = (*KINDS, *DURABILITIES)
#: survey patterns of a `cover` motion
PATTERNS = ALL_PATTERNS


def check_contracts(context: CheckContext) -> None:
    """Report incomplete or invalid contracts."""
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


def more_than_full(context: CheckContext, energy: Quantity | None, what: str) -> None:
    """Report an energy above 100 %."""
    if energy is not None and energy.dimension is Dimension.RATIO and energy.value > FULL:
        context.report.add(
            codes.BEYOND_VEHICLE,
            energy.span,
            f"the {what} may use `{context.report.text(energy.span)}`, more than a full battery",
            help="write its maximum consumption as a share of a full battery, less the reserve",
        )


def _complete(context: CheckContext, skill: SkillDecl) -> None:
    """Report missing clauses without a safe default; a landing needs no fallback."""
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
            help="a decision needs these clauses, and they have no safe default",
        )


def _motion(context: CheckContext, skill: SkillDecl, motion: MotionDecl) -> None:
    _parameter(context, skill, motion.altitude, HEIGHT)
    _parameter(context, skill, motion.lowest, HEIGHT)
    _parameter(context, skill, motion.every, LENGTH)
    _parameter(context, skill, motion.speed, SPEED)
    _parameter(context, skill, motion.time, DURATION)
    _parameter(context, skill, motion.distance, LENGTH)
    _distance(context, skill, motion.distance)
    _parameter(context, skill, motion.target, ZONE if motion.kind == "cover" else POSITION)
    if motion.kind == "fly" and motion.target is not None:
        first = next((p for p in skill.parameters if p.type.text == "position"), None)
        if first is not None and motion.target.text != first.name.text:
            context.report.add(
                codes.BAD_MOTION,
                motion.target.span,
                f"`fly to` needs the first parameter that is a position, `{first.name.text}`",
                labels=[(first.span, "declared here")],
            )
    if motion.pattern is not None:
        argument = context.arguments(skill).get(motion.pattern.text)
        if argument is None or argument.type.kind is not Kind.ENUMERATION:
            _not_parameter(context, skill, motion.pattern, "a choice among " + ", ".join(PATTERNS))
        else:
            for choice in argument.declaration.choices:
                one_of(context, codes.BAD_MOTION, choice, PATTERNS, "survey pattern")
                if choice.text in SIDEWAYS and motion.distance is None:
                    context.report.add(
                        codes.BAD_MOTION,
                        choice.span,
                        f"the pattern `{choice.text}` needs a distance from the structure, and the motion names none",
                        help="add a parameter such as `away: length in 5 m .. 30 m`, and `distance away` to the motion",
                        labels=[(motion.span, "the motion")],
                    )
    if motion.facing is not None:
        _facing(context, skill, motion)


def _facing(context: CheckContext, skill: SkillDecl, motion: MotionDecl) -> None:
    """Report an open path that faces inward: it has no middle."""
    wanted = None if motion.pattern is None else motion.pattern.text
    choices = [choice for each in skill.parameters if each.name.text == wanted for choice in each.choices]
    pattern = next((choice for choice in choices if choice.text not in INWARD), None)
    if pattern is None and choices:
        return
    context.report.add(
        codes.BAD_MOTION,
        motion.span,
        f"a path `facing inward` goes around something, and a `{DEFAULT_PATTERN if pattern is None else pattern.text}` "
        "does not",
        help="name a pattern: a choice among " + ", ".join(f"`{each}`" for each in INWARD),
        labels=[] if pattern is None else [(pattern.span, "this pattern is open")],
    )


def _parameter(context: CheckContext, skill: SkillDecl, name: Name | None, type: Type) -> None:
    if name is None:
        return
    argument = context.arguments(skill).get(name.text)
    if argument is None or argument.type != type:
        _not_parameter(context, skill, name, type.describe())


def _distance(context: CheckContext, skill: SkillDecl, name: Name | None) -> None:
    """Report a distance from a structure that may be negative."""
    argument = None if name is None else context.arguments(skill).get(name.text)
    range = None if argument is None else argument.declaration.range
    if argument is not None and range is not None and argument.type == LENGTH and (argument.low or 0) < 0:
        context.report.add(
            codes.NOT_POSITIVE, range.low.span, f"`{context.report.text(range.low.span)}` must not be negative"
        )


def _not_parameter(context: CheckContext, skill: SkillDecl, name: Name, expected: str) -> None:
    names = [parameter.name.text for parameter in skill.parameters]
    labels = [(p.span, f"`{name.text}` is declared here") for p in skill.parameters if p.name.text == name.text]
    context.report.add(
        codes.BAD_MOTION,
        name.span,
        f"`{name.text}` is not a parameter of `{skill.name.text}`; expected {expected}"
        if not labels
        else f"the parameter `{name.text}` is not {expected}",
        help=None if labels else suggestion(name.text, names),
        labels=labels,
    )


def check_fallbacks(context: CheckContext) -> None:
    """Report every fallback chain that may not end on the ground."""
    for skill in context.symbols.skills.values():
        if skill.fallback:
            check_chain(context, skill.fallback, skill, skill.fallback[0].span.to(skill.fallback[-1].span))


_AUTHORIZED = ("decision", "state", "authorization")
NEEDED = {"semantic": _AUTHORIZED, "tactical": _AUTHORIZED, "reflex": ("decision", "state", "effect")}


def check_records(context: CheckContext) -> None:
    """Report every skill whose `record` lacks a kind that an auditor needs."""
    for skill in context.symbols.skills.values():
        written = {name.text for name in skill.record}
        if written.isdisjoint(KINDS) or skill.timing_class is None:
            continue
        if not written.issubset(RECORDS):
            continue  # a misspelt word may be the missing one
        missing = [f"`{name}`" for name in NEEDED.get(skill.timing_class.text, ()) if name not in written]
        if missing:
            span = skill.record[0].span.to(skill.record[-1].span)
            whole = ", ".join([context.report.raw(span), *(name.strip("`") for name in missing)])
            context.report.add(
                codes.INSUFFICIENT_EVIDENCE,
                span,
                f"`{skill.name.text}` does not record {' and '.join(missing)}, so its decisions cannot be verified",
                help=f"add {' and '.join(missing)}, or remove `record`: then everything is recorded",
                labels=[(skill.timing_class.span, "required by this class")],
                fix=(span, whole, "add what is missing"),
            )


def check_durability(context: CheckContext) -> None:
    """Report every skill whose `record` has two durabilities, or one that its class does not allow."""
    for skill in context.symbols.skills.values():
        words = durability(context, skill.record)
        if words is None or words.text != WORDS[BUFFERED] or skill.timing_class is None:
            continue
        if skill.timing_class.text != "reflex":
            context.report.add(
                codes.FLEETING_EVIDENCE,
                words.span,
                f"`{skill.name.text}` is not a reflex, so its records cannot be `buffered`",
                help=f"write `{WORDS[WRITTEN]}`, or remove the word: the default is `synced`",
                labels=[(skill.timing_class.span, "only a reflex may be `buffered`")],
                fix=(words.span, WORDS[WRITTEN], f"write `{WORDS[WRITTEN]}`"),
            )


def durability(context: CheckContext, record: Sequence[Name]) -> Name | None:
    """Return the durability in a `record` clause; report a second, different one."""
    words = [name for name in record if name.text in WORDS]
    other = next((name for name in words if name.text != words[0].text), None)
    if other is not None:
        context.report.add(
            codes.TWO_DURABILITIES,
            other.span,
            f"records cannot be both `{words[0].text}` and `{other.text}`",
            help=f"keep one of them; from least to most durable: {listed(WORDS)}",
            labels=[(words[0].span, "also written here")],
        )
        return None
    return words[0] if words else None
