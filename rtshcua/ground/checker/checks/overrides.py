"""E0617: what a step says of its own only makes its skill's contract tighter.

Shorter times, more energy kept ready, fewer phases, records no less durable; clauses and kinds of evidence are added to
the skill's.
"""

from rtshcua.decision.durability import recorded_as
from rtshcua.diagnostics import codes
from rtshcua.ground.checker.checks.contracts import RECORDS, more_than_full
from rtshcua.ground.checker.checks.durability import durability
from rtshcua.ground.checker.conditions import check_condition
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.fields import one_of, quantity
from rtshcua.model.durability import WORDS
from rtshcua.model.ir.expression import Quantity
from rtshcua.model.ir.missions import Overrides
from rtshcua.model.ir.skills import SkillDecl
from rtshcua.model.quantity import Dimension, display

#: how long a clause may be unknown where a skill does not say (us)
DEFAULT_GRACE_US = 500_000


def check_overrides(context: Context, skill: SkillDecl, overrides: Overrides) -> None:
    """Report what is wrong with the block after a step of `skill`."""
    for field in (overrides.deadline, overrides.validity, overrides.duration):
        quantity(context, field, Dimension.DURATION)
    quantity(context, overrides.grace, Dimension.DURATION, positive=False)
    quantity(context, overrides.energy, Dimension.RATIO, positive=False)
    more_than_full(context, overrides.energy, "step")
    _shorter(context, skill, overrides)
    _phases(context, skill, overrides)
    for name in overrides.record:
        one_of(context, codes.UNKNOWN_RECORD, name, RECORDS, "kind of evidence")
    _durable(context, skill, overrides)
    scope = context.scope_of(skill)
    for clause in overrides.clauses:
        check_condition(scope, clause.condition)


def _shorter(context: Context, skill: SkillDecl, overrides: Overrides) -> None:
    """No time is longer than the skill's, and no less energy is kept ready."""
    for words, mine, skills, most in (
        ("deadline", overrides.deadline, skill.deadline, None),
        ("valid for", overrides.validity, skill.validity, None),
        ("lasts at most", overrides.duration, skill.duration, None),
        ("grace", overrides.grace, skill.grace, DEFAULT_GRACE_US),
    ):
        limit = skills.value if skills is not None else most
        if mine is not None and limit is not None and mine.value > limit:
            _looser(context, skill, words, mine, skills, display(limit, Dimension.DURATION), "at most")
    energy, kept = overrides.energy, skill.energy
    if energy is not None and kept is not None and energy.value < kept.value:
        _looser(context, skill, "energy at most", energy, kept, display(kept.value, Dimension.RATIO), "at least")


def _looser(
    context: Context, skill: SkillDecl, words: str, mine: Quantity, skills: Quantity | None, limit: str, side: str
) -> None:
    less = "" if side == "at most" else ", so less would be kept ready"
    at = (skill.name.span, f"`{skill.name.text}` is declared here, with {limit} where nothing is said")
    context.report.add(
        codes.NOT_TIGHTER,
        mine.span,
        f"`{words} {context.report.text(mine.span)}` is looser than the contract of `{skill.name.text}`, which says "
        f"{limit}{less}",
        help=f"a step may only be held to more than its skill: write {side} `{limit}`, or leave it out",
        labels=[at if skills is None else (skills.span, "the skill's own")],
        fix=(mine.span, limit, f"write `{limit}`"),
    )


def _durable(context: Context, skill: SkillDecl, overrides: Overrides) -> None:
    """The records of a step are no less durable than its skill's."""
    mine = durability(context, overrides.record)
    least = recorded_as(tuple(name.text for name in skill.record))
    if mine is None or WORDS.index(mine.text) >= least:
        return
    skills = next((name for name in skill.record if name.text == WORDS[least]), skill.name)
    said = "the skill's own" if skills is not skill.name else f"declared here; without a word it is `{WORDS[least]}`"
    context.report.add(
        codes.NOT_TIGHTER,
        mine.span,
        f"`{mine.text}` is less durable than the records of `{skill.name.text}`, which are `{WORDS[least]}`",
        help=f"a step may only be held to more than its skill: write `{WORDS[least]}` or more, or leave it out",
        labels=[(skills.span, said)],
        fix=(mine.span, WORDS[least], f"write `{WORDS[least]}`"),
    )


def _phases(context: Context, skill: SkillDecl, overrides: Overrides) -> None:
    """A step is valid in no phase in which its skill is not."""
    valid = {name.text for name in skill.phases}
    for name in overrides.phases:
        if valid and name.text not in valid:
            words = ", ".join(f"`{phase.text}`" for phase in skill.phases)
            context.report.add(
                codes.NOT_TIGHTER,
                name.span,
                f"the step would be valid during `{name.text}`, and `{skill.name.text}` is valid during {words} alone",
                help="a step may only be held to more than its skill: leave the phase out",
                labels=[(phase.span, "the skill's own") for phase in skill.phases],
            )
