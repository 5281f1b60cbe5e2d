"""The rules that may speak of an invocation, found without looking at any other."""

from collections.abc import Callable
from typing import NamedTuple

from rtshcua.decision.evaluate import Condition
from rtshcua.decision.link import PreparedLink
from rtshcua.model.flat.contract import Link
from rtshcua.model.flat.policy import Rule, RuleKind

ANY = -1  # no skill and no role has this index


class PreparedRule(NamedTuple):
    """A rule, its number in the policy, and its condition."""

    rule: Rule
    number: int
    condition: Condition


class PreparedDegrade(NamedTuple):
    """A degrade rule, and the link that it flies."""

    rule: Rule
    condition: Condition
    target: PreparedLink


class Candidates(NamedTuple):
    """The rules for one skill, role and source, in the order of the policy. Their conditions remain to be evaluated.

    A rule that degrades to the skill itself is not among them: it would refuse what it asks for.
    """

    forbids: tuple[PreparedRule, ...]
    permits: tuple[PreparedRule, ...]
    confirms: tuple[PreparedRule, ...]
    degrades: tuple[PreparedDegrade, ...]


class RuleIndex:
    """Rules by skill and role. Rules for any skill or role are kept once, and merged in for a key that is asked for.

    A rule lists at most four sources, so these are compared when merging. What was merged is remembered: asking again
    gives the same answer, and a loaded mission asks for few keys.
    """

    __slots__ = ("_buckets", "_compile", "_known", "_link", "_rules")

    def __init__(
        self,
        rules: tuple[Rule, ...],
        compile: Callable[[Rule, int], Condition],
        link: Callable[[Link], PreparedLink],
    ) -> None:
        self._rules, self._compile, self._link = rules, compile, link
        self._known: dict[tuple[int, int, int], Candidates] = {}
        self._buckets: dict[tuple[int, int], list[int]] = {}
        for number, rule in enumerate(rules):
            for skill in rule.skills or (ANY,):
                for role in rule.roles or (ANY,):
                    self._buckets.setdefault((skill, role), []).append(number)

    def candidates(self, skill: int, role: int, source: int) -> Candidates:
        """The rules that name this skill, role and source, or any."""
        key = (skill, role, source)
        found = self._known.get(key)
        if found is None:
            found = self._known[key] = self._merged(skill, role, source)
        return found

    def _merged(self, skill: int, role: int, source: int) -> Candidates:
        keys = ((skill, role), (skill, ANY), (ANY, role), (ANY, ANY))
        numbers = sorted(number for key in keys for number in self._buckets.get(key, ()))
        fitting = [number for number in numbers if source in (self._rules[number].sources or (source,))]
        return Candidates(
            self._of(RuleKind.FORBID, fitting),
            self._of(RuleKind.PERMIT, fitting),
            self._of(RuleKind.CONFIRM, fitting),
            tuple(
                PreparedDegrade(rule, self._compile(rule, number), self._link(rule.target))
                for number in fitting
                if (rule := self._rules[number]).kind == RuleKind.DEGRADE
                and rule.target is not None
                and rule.target.skill != skill
            ),
        )

    def _of(self, kind: RuleKind, numbers: list[int]) -> tuple[PreparedRule, ...]:
        return tuple(
            PreparedRule(rule, number, self._compile(rule, number))
            for number in numbers
            if (rule := self._rules[number]).kind == kind
        )
