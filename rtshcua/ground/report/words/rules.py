"""Rules of a policy in words: who may have what done, who must approve it, and what is done instead."""

from collections.abc import Sequence
from typing import Final

from rtshcua.ground.report.words.conditions import told_clauses, told_condition
from rtshcua.ground.report.words.skills import told_link
from rtshcua.ground.report.words.values import told_value
from rtshcua.ground.report.words.vocabulary import Vocabulary, listed, name, named, sentence
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.policies import Airspace, Delegation, Rule, Use
from rtshcua.model.quantity import Dimension, display

#: how each source that may speak for a role is told
SOURCES: Final = {
    "agent": "an agent",
    "operator": "a person at the controls",
    "onboard": "software on board",
    "reflex": "a reflex on board",
}
ANYONE: Final = "anyone"


def sources_of(rule: Rule) -> tuple[str, ...]:
    """The sources that a rule is about: those written, or what leaving them out means."""
    if rule.through:
        return tuple(source.text for source in rule.through)
    narrow = rule.kind == "permit" and rule.roles
    return ("operator",) if narrow else tuple(SOURCES)


def through(sources: Sequence[str]) -> str:
    """The sources, in words."""
    if set(SOURCES) <= set(sources):
        return "any source"
    return listed([SOURCES.get(source, name(source)) for source in sources], "or")


def told_rule(rule: Rule, names: Vocabulary) -> str:
    """A rule as a sentence of its own; one that a template or a delegation brought about says so."""
    words = _rule(rule, names)
    if rule.where_fitted:
        words = f"{words} (where the vehicle has the sensors for it)"
    for origin in reversed(rule.origin):
        words = f"{_origin(origin, names)}, {words}"
    return sentence(words)


def _rule(rule: Rule, names: Vocabulary) -> str:
    skills = skills_of(rule.skills)
    when = "" if rule.when is None else f", if {told_condition(rule.when, names)}"
    match rule.kind:
        case "permit":
            return f"{_whom(rule.roles)} may have {skills} done, asking through {through(sources_of(rule))}{when}"
        case "forbid":
            asked = f", asking through {through(sources_of(rule))}" if rule.through else ""
            whom = "nobody" if not rule.roles else f"the role {named(_texts(rule.roles), 'or')}"
            return f"{whom} may{' not' if rule.roles else ''} have {skills} done{asked}{when}"
        case "confirm":
            return f"{skills} must be approved by {approver(rule)}{when}"
        case "degrade":
            instead = "" if rule.target is None else told_link(rule.target, names)
            return f"{instead} is flown instead of {_replaced(rule)}{when}"


def approver(rule: Rule) -> str:
    """Who confirms, and how long is waited."""
    who = "somebody" if rule.approver is None else f"a person of the role {name(rule.approver.text)}"
    if rule.another is not None:
        who += f" and by another person of the role {name(rule.another.text)}"
    if rule.within is None:
        return who
    return f"{who} (within {display(rule.within.value, Dimension.DURATION)}, or it is denied)"


def skills_of(skills: Sequence[Name]) -> str:
    """The skills of a rule; none stand for all of them."""
    return named(_texts(skills), "or") if skills else "any skill"


def _replaced(rule: Rule) -> str:
    """The skills that a `degrade` is about: never what it flies itself (`decision/prepare.py`)."""
    target = "" if rule.target is None else rule.target.skill.text
    left = [skill for skill in rule.skills if skill.text != target]
    if not rule.skills:
        return "any other skill"
    return skills_of(left) if left else "nothing else"


def told_airspace(airspace: Airspace | None) -> str:
    """Where the vehicle may be at all."""
    if airspace is None:
        return told_limits((), ())
    return told_limits(_texts(airspace.inside), _texts(airspace.outside))


def told_limits(inside: Sequence[str], outside: Sequence[str]) -> str:
    """Where the vehicle may be at all, by the names of zones."""
    if not inside and not outside:
        return "This policy sets no limits to where the vehicle may be, beyond those of its rules and skills."
    parts = []
    if inside:
        parts.append(f"inside of {_all(inside)}")
    if outside:
        parts.append(f"outside of {_all(outside)}")
    return f"The vehicle may only be {' and '.join(parts)}: for every planned path, and at every moment in flight."


def _all(zones: Sequence[str]) -> str:
    return named(zones) if len(zones) == 1 else f"each of ({named(zones)})"


def told_evidence(without: str) -> str:
    """What becomes of a flight whose records are not kept."""
    if without == "refuse":
        return "If the records of a flight cannot be kept, what runs may finish, and no further step begins."
    return "If the records of a flight cannot be kept, the mission is given up and the vehicle comes down."


def told_silence(limit_us: int, then: str) -> str:
    """What follows after a long silence of the vehicle."""
    again = "when it is heard again and its state is fresh"
    if then == "continue":
        follows = f"the step goes on {again}, as long as all that it needs holds"
    else:
        follows = f"the mission is given up {again}, and the contingency flies"
    limit = display(limit_us, Dimension.DURATION)
    return f"If the vehicle was silent for longer than {limit}, {follows}. A shorter silence ends nothing."


def _origin(origin: Node, names: Vocabulary) -> str:
    match origin:
        case Use():
            given = [
                f"{'' if each.name is None else f'{name(each.name.text)} = '}{told_value(each.value, names)}"
                for each in origin.arguments
            ]
            return f"by the template {name(origin.template.text)}" + (f" ({', '.join(given)})" if given else "")
        case Delegation():
            return told_delegation(origin, names)
        case _:
            return "by what is used here"


def told_delegation(one: Delegation, names: Vocabulary) -> str:
    """A delegation, as it stands before what it brings about."""
    asked = f" through {through(_texts(one.through))}" if one.through else ""
    when = "" if one.when is None else f" (if {told_condition(one.when, names)})"
    grantor, grantee = name(one.grantor.text), name(one.grantee.text)
    return f"by delegation of {skills_of(one.skills)} from {grantor} to {grantee}{asked}{when}"


def conditions_of(rule: Rule, names: Vocabulary) -> tuple[str, ...]:
    """What must hold for a rule, one line each."""
    return told_clauses(rule.when, names)


def _whom(roles: Sequence[Name]) -> str:
    return f"the role {named(_texts(roles), 'or')}" if roles else ANYONE


def _texts(names: Sequence[Name]) -> list[str]:
    return [each.text for each in names]
