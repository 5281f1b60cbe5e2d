"""E1306: a policy that gates nothing. It looks like one, and whatever its skills can be asked for, it permits.

Looked at are the skills that take the vehicle elsewhere: to hold, to go home and to land is for everyone. A policy
gates nothing where each of them that it permits at all is permitted to everybody through every source, in a situation
of any kind that the vehicle can be met in (`deciding`), and no `forbid`, `confirm` or `degrade` ever acts on it, and
nothing in its airspace restricts where the vehicle comes (`reach`). Whether conditions leave anything out is asked of
the analysis, whose answer is a situation that the evaluator agreed to; where it cannot tell, nothing is said.
"""

from collections.abc import Iterator

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.ground.lint.deciding import Deciding
from rtshcua.ground.lint.reach import is_open
from rtshcua.ground.lint.subject import Subject
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.ruleset import Ruleset
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.policy import RuleKind

_MOVING = (MotionKind.CLIMB, MotionKind.FLY, MotionKind.COVER)
#: more permits of one skill than this are not looked at together
_TOGETHER = 12


def check(subject: Subject) -> Iterator[Diagnostic]:
    """Report policies that refuse nothing."""
    for ground in subject.lowered():
        deciding = Deciding(ground)
        moving = _permitted(ground, deciding.rules)
        if moving and is_open(ground.prepared.policy) and all(_open(deciding, skill) for skill in moving):
            yield _found(ground, deciding.rules, moving)


def _permitted(ground: ProofContext, rules: Ruleset) -> list[int]:
    """The skills that move the vehicle and that a permit is about."""
    permits = [number for group in rules.groups if group.kind == RuleKind.PERMIT for number in group.rules]
    skills = dict.fromkeys(skill for number in permits for skill in rules.skills(number))
    contracts = ground.prepared.policy.contracts
    return [skill for skill in skills if contracts[skill].motion.kind in _MOVING]


def _open(deciding: Deciding, skill: int) -> bool:
    """Whether nothing that the skill can be asked for is refused, as far as can be told."""
    rules = deciding.rules
    about = [number for number in range(len(rules.policy.rules)) if skill in rules.skills(number)]
    permits = [number for number in about if rules.rule(number).kind == RuleKind.PERMIT]
    if any(deciding.acts(number, skill) for number in about if number not in permits):
        return False
    anyone = [number for number in permits if not rules.rule(number).roles and not rules.rule(number).sources]
    return 0 < len(anyone) <= _TOGETHER and deciding.always_permit(anyone, skill)


def _found(ground: ProofContext, rules: Ruleset, moving: list[int]) -> Diagnostic:
    declaration = ground.lowered.declaration
    contracts = ground.prepared.policy.contracts
    names = ", ".join(f"`{contracts[skill].name}`" for skill in moving)
    permits = [
        group.span
        for group in rules.groups
        if group.kind == RuleKind.PERMIT and any(skill in rules.skills(group.rules[0]) for skill in moving)
    ]
    return Diagnostic(
        codes.GATES_NOTHING,
        f"`{declaration.name.text}` gates nothing: everyone may ask for {names}, whatever the arguments and the state",
        declaration.name.span,
        "name the roles, add conditions with `when` that can fail, or an `airspace` that the vehicle can leave",
        tuple(
            Label(span, "this leaves nothing out" if len(permits) == 1 else "together, these leave nothing out")
            for span in permits
        ),
    )
