"""Who may do what: the rules of a policy by role and skill."""

from collections.abc import Iterable, Sequence
from typing import Final

from rtshcua.ground.report.model import Hindrance, Right, Rights, Way
from rtshcua.ground.report.subject import Subject
from rtshcua.ground.report.words.rules import approver, conditions_of, sources_of, through
from rtshcua.ground.report.words.vocabulary import Vocabulary
from rtshcua.model.ir.policies import Rule
from rtshcua.model.ir.skills import SkillDecl

#: stands for every role that no rule names
EVERYBODY_ELSE: Final = ""
YES, CONDITIONS, APPROVAL, REPLACED, NO = "yes", "on conditions", "after approval", "something else", "no"


def rights(subject: Subject) -> tuple[Rights, ...]:
    """The rights of every role of the policy, and of everybody else."""
    skills = [contract.name for contract in subject.policy.contracts]
    return tuple(
        Rights(role, tuple(_right(subject, role, skill) for skill in skills))
        for role in (*subject.policy.roles, EVERYBODY_ELSE)
    )


def _right(subject: Subject, role: str, skill: str) -> Right:
    ways: list[Way] = []
    confirmations: list[Hindrance] = []
    prohibitions: list[Hindrance] = []
    about = [(number, rule) for number, rule in enumerate(subject.rules, 1) if _about(rule, role, skill)]
    for number, rule in about:
        conditions = conditions_of(rule, rule_names(subject, rule))
        match rule.kind:
            case "permit":
                ways.append(Way(number, through(sources_of(rule)), conditions))
            case "confirm":
                confirmations.append(Hindrance(number, approver(rule), conditions))
            case "forbid":
                asked = f"asked through {through(sources_of(rule))}" if rule.through else ""
                prohibitions.append(Hindrance(number, asked, conditions))
            case _:
                pass
    answer = _answer(skill, [rule for _, rule in about])
    return Right(skill, answer, tuple(ways), tuple(confirmations), tuple(prohibitions))


def _answer(skill: str, about: list[Rule]) -> str:
    """In short, for those sources that some permit names and that are not always forbidden; what is forbidden to others
    is no condition. `yes`: through one of them at least nothing is asked besides.
    """
    never = _sources(rule for rule in about if rule.kind == "forbid" and rule.when is None)
    if not _sources(rule for rule in about if rule.kind == "permit") - never:
        return NO
    if any(rule.target is not None and rule.target.skill.text != skill and rule.when is None for rule in about):
        return REPLACED
    sometimes = _sources(rule for rule in about if rule.kind == "forbid")
    plainly = _sources(rule for rule in about if rule.kind == "permit" and rule.when is None) - sometimes
    confirms = [rule for rule in about if rule.kind == "confirm"]
    if any(rule.when is None for rule in confirms):
        return APPROVAL if plainly else f"{APPROVAL}, {CONDITIONS}"
    return YES if plainly and not confirms else CONDITIONS


def _sources(rules: Iterable[Rule]) -> frozenset[str]:
    return frozenset(source for rule in rules for source in sources_of(rule))


def _about(rule: Rule, role: str, skill: str) -> bool:
    """Whether a rule says something of a skill asked for by a role; a `confirm` is about all roles."""
    if rule.skills and skill not in {name.text for name in rule.skills}:
        return False
    return not rule.roles or role in {name.text for name in rule.roles}


def rule_names(subject: Subject, rule: Rule) -> Vocabulary:
    """What the names in a rule stand for: it may read those arguments that all of its skills have."""
    own = [name.text for name in rule.skills] or [contract.name for contract in subject.policy.contracts]
    return asked_of(subject, [subject.symbols.skills[name] for name in own])


def asked_of(subject: Subject, skills: Sequence[SkillDecl]) -> Vocabulary:
    """The names within what is about some skills."""
    types = [{each.name.text: each.type.text for each in skill.parameters} for skill in skills]
    shared = frozenset.intersection(*map(frozenset, types)) if types else frozenset()
    places = [name for name in shared if all(each[name] == "position" for each in types)]
    return subject.names.asked(shared, places)
