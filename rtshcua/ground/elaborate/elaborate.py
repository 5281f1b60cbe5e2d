"""Elaborate the units of a program to plain rules and steps. `repeat N { ... }` becomes its steps, N times."""

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.context import CheckContext, Instance
from rtshcua.ground.checker.report import Report
from rtshcua.ground.elaborate.delegation import delegated
from rtshcua.ground.elaborate.parameters import ParameterSettings, ambiguous, assigned, instances
from rtshcua.ground.elaborate.templates import sample, used
from rtshcua.model.flat.limits import MAX_INVOCATIONS, MAX_RULES
from rtshcua.model.ir.missions import Item, MissionDecl, Repeat, Step
from rtshcua.model.ir.policies import PolicyDecl, RuleDecl
from rtshcua.model.ir.program import Unit


def unrolled(report: Report, mission: MissionDecl) -> MissionDecl:
    """Return the mission with plain steps; invalid repetitions are reported and taken once."""
    repeats = [item for phase in mission.phases for item in _repeats(phase.items)]
    if not repeats:
        return mission
    good = not [repeat for repeat in repeats if not _is_positive(report, repeat)]
    total = sum(_total(phase.items) for phase in mission.phases) if good else 0
    if total > MAX_INVOCATIONS:
        good = False
        most = max(repeats, key=lambda repeat: repeat.count.value * _total(repeat.items))
        report.add(
            codes.MISSION_STEPS,
            mission.name.span,
            f"the mission `{mission.name.text}` has {total} steps; the limit is {MAX_INVOCATIONS}",
            help="repeat less, or split it into several missions",
            labels=[(most.count.span, f"these are {most.count.value * _total(most.items)} steps")],
        )
    phases = tuple(phase.copied(items=tuple(_steps(phase.items, once=not good))) for phase in mission.phases)
    return mission.copied(phases=phases)


def _repeats(items: Sequence[Item]) -> Iterator[Repeat]:
    for item in items:
        if isinstance(item, Repeat):
            yield item
            yield from _repeats(item.items)


def _is_positive(report: Report, repeat: Repeat) -> bool:
    """Whether the count of a repetition is positive; reports it if not."""
    count = repeat.count
    if count.value < 1:
        report.add(
            codes.NOT_POSITIVE,
            count.span,
            f"`{report.text(count.span)}` must be above zero",
            help="remove a `repeat` that is never flown",
        )
        return False
    return True


def _total(items: Sequence[Item]) -> int:
    """The number of steps, without making them."""
    return sum(1 if isinstance(item, Step) else item.count.value * _total(item.items) for item in items)


def _steps(items: Sequence[Item], *, once: bool) -> Iterator[Step]:
    """The steps in order. Each is a node of its own, because results about a step are kept by its identity."""
    for item in items:
        if isinstance(item, Step):
            yield item.copied()
        else:
            for _ in range(1 if once else item.count.value if _total(item.items) else 0):
                yield from _steps(item.items, once=once)


#: a file and all its imports
Closure = Callable[[str], frozenset[str]]


class ElaboratedProgram(NamedTuple):
    """The units, the checked instances of missions with parameters, and sample rules of unused templates."""

    units: tuple[Unit, ...]
    instances: dict[str, tuple[Instance, ...]]
    samples: tuple[RuleDecl, ...]


def elaborate(
    context: CheckContext,
    units: Sequence[Unit],
    closure: Closure,
    chosen: str | None = None,
    settings: ParameterSettings | None = None,
) -> ElaboratedProgram:
    """Elaborate a program; `context` has its names as written.

    The mission `chosen` gets the values of `settings` and its defaults, and needs one for every parameter. All other
    missions are checked with sample values.
    """
    missions = _Missions(context, closure, chosen, settings or ParameterSettings())
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
    return ElaboratedProgram(tuple(found), missions.instances, tuple(samples))


def _policy(context: CheckContext, policy: PolicyDecl, seen: set[str]) -> PolicyDecl:
    """A policy with all its rules in source order, then those of its delegations; `seen` collects used templates."""
    if len(policy.rules) > MAX_RULES:
        return policy.copied(rules=_fitting(context, policy, policy.rules), uses=(), delegations=())
    if not policy.uses and not policy.delegations:
        return policy
    parts: list[tuple[int, tuple[RuleDecl, ...]]] = [(rule.span.start, (rule,)) for rule in policy.rules]
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


def _fitting(context: CheckContext, policy: PolicyDecl, rules: tuple[RuleDecl, ...]) -> tuple[RuleDecl, ...]:
    """Report too many rules and return those within the limit."""
    context.report.add(
        codes.TOO_MANY,
        policy.name.span,
        f"`{policy.name.text}` has more than {MAX_RULES:,} rules, the limit",
        help="later rules were not checked; write fewer rules, with wider conditions",
    )
    return rules[:MAX_RULES]


class _Missions:
    def __init__(
        self, context: CheckContext, closure: Closure, chosen: str | None, settings: ParameterSettings
    ) -> None:
        self.instances: dict[str, tuple[Instance, ...]] = {}
        self._context = context
        self._closure = closure
        self._chosen = chosen
        self._settings = settings

    def elaborated(self, mission: MissionDecl) -> MissionDecl:
        """Return a mission with plain steps; one with parameters as its first instance."""
        plain = unrolled(self._context.report, mission)
        name = plain.name.text
        if self._context.symbols.missions.get(name) is not mission:
            return plain  # declared twice, which is reported
        if plain.parameters and ambiguous(self._context, plain):
            self.instances[name] = ()
            return plain
        if name == self._chosen and (plain.parameters or self._settings != ParameterSettings()):
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
