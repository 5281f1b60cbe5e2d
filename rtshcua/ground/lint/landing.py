"""E1312: a `degrade` that holds for a skill that lands, and flies what does not land there.

A `degrade` with `any` covers every skill, also one that a person asks for to have the vehicle down at once: with the
rule, a request to land becomes a flight home. Who asks to land has often seen what no signal says. Where the target
lands too, nothing is flown further than was asked.
"""

from collections.abc import Iterator

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.ground.lint.subject import Subject
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.policies import Rule

_LAND = "land"


def check(subject: Subject) -> Iterator[Diagnostic]:
    """Report degrade rules that keep a skill from landing."""
    for unit in subject.asked:
        rules = [rule for policy in unit.policies for rule in policy.rules]
        rules += [rule for template in unit.templates for rule in template.rules]
        for rule in rules:
            if rule.kind == "degrade" and rule.target is not None and not _lands(subject, rule.target.skill.text):
                yield from _kept_up(subject, rule, rule.target.skill.text)


def _lands(subject: Subject, name: str) -> bool:
    skill = subject.symbols.skills.get(name)
    return skill is not None and skill.motion is not None and skill.motion.kind == _LAND


def _kept_up(subject: Subject, rule: Rule, target: str) -> Iterator[Diagnostic]:
    landing = [name for name in subject.symbols.skills if _lands(subject, name)]
    if not rule.skills and landing:
        help = "name the skills that you mean, and leave out those that land"
        yield _found(subject, rule, target, landing[0], help)
    for name in rule.skills:
        if name.text in landing:
            yield _found(
                subject, rule, target, name.text, f"leave `{name.text}` out, or degrade it to what lands", name
            )


def _found(subject: Subject, rule: Rule, target: str, landing: str, help: str, name: Name | None = None) -> Diagnostic:
    motion = subject.symbols.skills[landing].motion
    assert motion is not None
    return Diagnostic(
        codes.KEPT_FROM_LANDING,
        f"whoever asks for `{landing}` under this condition gets `{target}`, which does not land on the spot",
        rule.span if name is None else name.span,
        help,
        (Label(motion.span, f"`{landing}` lands here and now"),),
    )
