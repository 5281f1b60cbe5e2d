"""The units of a program with plain rules and steps in the place of what stands for them."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.context import Context, Instance
from rtshcua.ground.elaborate.delegation import delegated
from rtshcua.ground.elaborate.parameters import ambiguous, assigned, instances
from rtshcua.ground.elaborate.repeat import unrolled
from rtshcua.ground.elaborate.settings import Settings
from rtshcua.ground.elaborate.templates import sample, used
from rtshcua.model.flat.limits import MAX_RULES
from rtshcua.model.ir.missions import MissionDecl
from rtshcua.model.ir.policies import PolicyDecl, Rule
from rtshcua.model.ir.program import Unit

#: a file and all that it imports
Closure = Callable[[str], frozenset[str]]


class Elaborated(NamedTuple):
    """The units; of each mission with parameters those that are checked; the rules of templates without a use."""

    units: tuple[Unit, ...]
    instances: dict[str, tuple[Instance, ...]]
    samples: tuple[Rule, ...]


def elaborate(
    context: Context,
    units: Sequence[Unit],
    closure: Closure,
    chosen: str | None = None,
    settings: Settings | None = None,
) -> Elaborated:
    """Elaborate a program; `context` has its names as they are written.

    The mission `chosen` gets the values of `settings` and its defaults, and must have one for every parameter; all
    other missions are checked for any.
    """
    missions = _Missions(context, closure, chosen, settings or Settings())
    seen: set[str] = set()
    found = [
        unit.copied(
            policies=tuple(_policy(context, policy, seen) for policy in unit.policies),
            missions=tuple(missions.elaborated(mission) for mission in unit.missions),
        )
        if unit.policies or unit.missions
        else unit
        for unit in units
    ]
    samples = [
        rule
        for name, template in context.symbols.templates.items()
        if name not in seen
        for rule in sample(context, template)
    ]
    return Elaborated(tuple(found), missions.instances, tuple(samples))


def _policy(context: Context, policy: PolicyDecl, seen: set[str]) -> PolicyDecl:
    """A policy with all its rules in source order, then those of its delegations; `seen` gathers used templates."""
    if len(policy.rules) > MAX_RULES:
        return policy.copied(rules=_fitting(context, policy, policy.rules), uses=(), delegations=())
    if not policy.uses and not policy.delegations:
        return policy
    parts: list[tuple[int, tuple[Rule, ...]]] = [(rule.span.start, (rule,)) for rule in policy.rules]
    whole, many = True, len(policy.rules)
    for use in policy.uses:
        rules = used(context, use)
        whole = whole and rules is not None
        if rules is not None:
            seen.add(use.template.text)
            parts.append((use.span.start, rules))
            many += len(rules)
            if many > MAX_RULES:
                break
    parts.sort(key=lambda part: part[0])
    plain = tuple(rule for _, rules in parts for rule in rules)
    if many > MAX_RULES:
        return policy.copied(rules=_fitting(context, policy, plain))
    return policy.copied(rules=delegated(context, policy, plain, whole=whole))


def _fitting(context: Context, policy: PolicyDecl, rules: tuple[Rule, ...]) -> tuple[Rule, ...]:
    """As many rules as are looked at; that there are more is reported."""
    context.report.add(
        codes.TOO_MANY,
        policy.name.span,
        f"`{policy.name.text}` has more than {MAX_RULES:,} rules, which is what fits on board",
        help="the rules after those are not looked at; write fewer, with wider conditions",
    )
    return rules[:MAX_RULES]


class _Missions:
    def __init__(self, context: Context, closure: Closure, chosen: str | None, settings: Settings) -> None:
        self.instances: dict[str, tuple[Instance, ...]] = {}
        self._context = context
        self._closure = closure
        self._chosen = chosen
        self._settings = settings

    def elaborated(self, mission: MissionDecl) -> MissionDecl:
        """A mission with plain steps; with parameters, its first instance."""
        plain = unrolled(self._context.report, mission)
        name = plain.name.text
        if self._context.symbols.missions.get(name) is not mission:
            return plain  # declared twice, which is reported
        if plain.parameters and ambiguous(self._context, plain):
            self.instances[name] = ()
            return plain
        if name == self._chosen and (plain.parameters or self._settings != Settings()):
            one = assigned(self._context, plain, self._settings)
            if one is not None:
                self.instances[name] = (one,)
                return one.mission
        if not plain.parameters:
            return plain
        policy = self._context.symbols.policies.get(plain.policy.text)
        files = self._closure((policy or plain).span.file)
        self.instances[name] = found = tuple(instances(self._context, plain, files))
        return found[0].mission if found else plain
