"""The rules of a policy to the flat form, one for each layout of the arguments that it reads."""

from collections.abc import Iterable, Iterator, Mapping

from msgspec.structs import replace

from rtshcua.ground.checker.conditions import references
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.scope import Scope
from rtshcua.ground.checker.uses import brought_about
from rtshcua.ground.lower.conditions import Conditions, Place
from rtshcua.ground.lower.contracts import Contracts, cells_of
from rtshcua.ground.lower.files import Files, shortened
from rtshcua.ground.lower.lacking import rule_applies
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.policy import LeftOut, Rule, RuleKind
from rtshcua.model.ir.expression import Condition, Junction
from rtshcua.model.ir.node import Node
from rtshcua.model.ir.policies import Delegation, PolicyDecl
from rtshcua.model.ir.policies import Rule as RuleDecl
from rtshcua.model.ir.skills import SkillDecl


class Rules:
    """Lowers the rules of one policy; `numbers` are the indexes of its skills, `roles` its roles in order.

    `without` are the signals that the vehicle is without.
    """

    def __init__(
        self,
        context: Context,
        numbers: Mapping[str, int],
        roles: tuple[str, ...],
        conditions: Conditions,
        contracts: Contracts,
        files: Files,
        without: Iterable[str],
    ) -> None:
        self._without = frozenset(without)
        self._context = context
        self._numbers = numbers
        self._roles = {role: number for number, role in enumerate(roles)}
        self._conditions = conditions
        self._contracts = contracts
        self._files = files

    def lowered(self, policy: PolicyDecl) -> tuple[tuple[Rule, RuleDecl], ...]:
        """All rules in source order, with their declarations; one whose skills keep its arguments in different cells
        becomes several, and one that does not apply to the vehicle none.
        """
        found: list[tuple[Rule, RuleDecl]] = []
        for rule in policy.rules:
            if not rule_applies(rule, self._without):
                self._contracts.left_out.append(LeftOut(-1, rule.kind, *self._files.place(rule.span)))
                continue
            with self._context.report.within(brought_about(rule)):
                found += [(flat, rule) for flat in self._rule(rule)]
        return tuple(found)

    def _rule(self, rule: RuleDecl) -> Iterable[Rule]:
        if not rule.skills:
            yield self._flat(rule, ())
            return
        groups: dict[tuple[tuple[str, int], ...], list[SkillDecl]] = {}
        read = set() if rule.when is None else {reference.name for reference in references(rule.when)}
        for name in rule.skills:
            skill = self._context.symbols.skills[name.text]
            layout = tuple(sorted((each, cell) for each, cell in cells_of(skill).items() if each in read))
            groups.setdefault(layout, []).append(skill)
        for skills in groups.values():
            yield self._flat(rule, skills)

    def _flat(self, rule: RuleDecl, skills: Iterable[SkillDecl]) -> Rule:
        skills = tuple(skills)
        kind = RuleKind[rule.kind.upper()]
        arguments = self._context.arguments(skills[0]) if skills else {}
        cells = cells_of(skills[0]) if skills else {}
        place = Place(
            Scope(self._context.symbols, self._context.report, arguments), cells, strict=kind is RuleKind.PERMIT
        )
        _, source, start, end = self._files.place(rule.span)
        return Rule(
            kind=int(kind),
            skills=tuple(sorted({self._numbers[skill.name.text] for skill in skills})),
            roles=tuple(sorted({self._roles[role.text] for role in rule.roles})),
            sources=_sources(rule, kind),
            when=None if rule.when is None else self._when(rule.when, rule, place),
            approver=-1 if rule.approver is None else self._roles[rule.approver.text],
            within_us=0 if rule.within is None else rule.within.value,
            target=None if rule.target is None else self._contracts.link(rule.target),
            text=shortened(": ".join(self._quoted(node) for node in (*rule.origin, rule))),
            source=source,
            start=start,
            end=end,
            second=-1 if rule.another is None else self._roles[rule.another.text],
        )

    def _when(self, when: Condition, rule: RuleDecl, place: Place) -> Clause:
        """The condition of a rule; that of a delegated one is quoted with all that was added to it."""
        clause = self._conditions.clause(when, place)
        if not any(isinstance(node, Delegation) for node in rule.origin) or not isinstance(when, Junction):
            return clause
        texts = (
            f"({text})" if _is_choice(part) else text for part in _delegated(when) for text in [self._quoted(part)]
        )
        return replace(clause, text=shortened(" and ".join(texts)))

    def _quoted(self, node: Node) -> str:
        return self._context.report.text(node.span)


def _is_choice(condition: Condition) -> bool:
    return isinstance(condition, Junction) and condition.operator == "or"


def _delegated(when: Condition) -> Iterator[Condition]:
    """What a permit and its delegations say, in the order in which they were put together."""
    if isinstance(when, Junction) and when.span == when.operands[-1].span:  # made, not written
        yield from _delegated(when.operands[0])
        yield when.operands[-1]
    else:
        yield when


def _sources(rule: RuleDecl, kind: RuleKind) -> tuple[int, ...]:
    """The sources that a rule is about: a permit to a role is to an operator, unless it says who may speak for them.

    What stops a skill stops it whoever speaks, unless the rule names its sources.
    """
    if rule.through:
        return tuple(sorted({int(SourceKind[name.text.upper()]) for name in rule.through}))
    if kind is RuleKind.PERMIT and rule.roles:
        return (int(SourceKind.OPERATOR),)
    return ()
