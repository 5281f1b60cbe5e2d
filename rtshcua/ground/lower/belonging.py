"""E0207: what a policy flies by stands in its own files.

Otherwise a mission could bring a zone, a signal or a skill of its own under a name that the policy relies on.
"""

from collections.abc import Iterable, Iterator, Sequence

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.checks.made_of import named
from rtshcua.ground.checker.conditions import references
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.symbols import WORDS
from rtshcua.model.ir.expression import Condition, Reference
from rtshcua.model.ir.places import ENTRY, VehicleDecl
from rtshcua.model.ir.policies import PolicyDecl
from rtshcua.model.ir.skills import LinkDecl, SkillDecl


def belongs(
    context: Context, policy: PolicyDecl, skills: Sequence[SkillDecl], vehicle: VehicleDecl, files: frozenset[str]
) -> bool:
    """Whether everything that a policy and its skills name is declared in its files; reports what is not, once each."""
    foreign: dict[str, Span] = {}

    def note(name: str, span: Span) -> None:
        name = name if name in context.symbols.declared else name.removesuffix(ENTRY)
        declared = context.symbols.declared.get(name)
        if declared is not None and declared.span.file not in files:
            foreign.setdefault(name, span)

    zones = (zone for zone in context.symbols.zones.values() if zone.span.file in files)
    of_zones = ((each.name, each.span) for zone in zones for each in named(zone))
    for name, span in (*_of_policy(policy), *(found for skill in skills for found in _of_skill(skill)), *of_zones):
        note(name, span)
        signal = context.symbols.signals.get(name)
        if signal is not None:
            note(signal.type.text, span)
    note(vehicle.name.text, policy.name.span)
    for name, span in foreign.items():
        declared = context.symbols.declared[name]
        context.report.add(
            codes.NOT_IN_POLICY,
            span,
            f"`{name}` is {WORDS[type(declared)]} that the policy `{policy.name.text}` does not import",
            help="import its file in the policy's: a policy is signed with all that it relies on",
            labels=[(declared.name.span, "declared here")],
        )
    return not [each for each in skills if not _own_sizes(context, policy, each, files)] and not foreign


def _own_sizes(context: Context, policy: PolicyDecl, skill: SkillDecl, files: frozenset[str]) -> bool:
    """Whether what is said of a skill's sizes stands in the policy's files; reports what does not."""
    sizes = context.symbols.sizes.get(skill.name.text)
    if sizes is None or sizes.span.file in files:
        return True
    context.report.add(
        codes.NOT_IN_POLICY,
        sizes.skill.span,
        f"the policy `{policy.name.text}` does not import these sizes of `{skill.name.text}`",
        help="import this file in the policy's: a policy is signed once for all its missions",
        labels=[(policy.name.span, "the policy is declared here")],
    )
    return False


def _of_policy(policy: PolicyDecl) -> Iterator[tuple[str, Span]]:
    for rule in policy.rules:
        for name in rule.skills:
            yield name.text, name.span
        if rule.when is not None:
            yield from _of_condition(rule.when)
    links = [*policy.contingency, *(rule.target for rule in policy.rules if rule.target is not None)]
    yield from _of_links(links)
    if policy.airspace is not None:
        for name in (*policy.airspace.inside, *policy.airspace.outside):
            yield name.text, name.span


def _of_skill(skill: SkillDecl) -> Iterator[tuple[str, Span]]:
    yield skill.name.text, skill.name.span
    parameters = {parameter.name.text for parameter in skill.parameters}
    for clause in (*skill.require, *skill.assume, *skill.maintain):
        yield from ((name, span) for name, span in _of_condition(clause.condition) if name not in parameters)
    yield from _of_links(skill.fallback)


def _of_links(links: Iterable[LinkDecl]) -> Iterator[tuple[str, Span]]:
    for link in links:
        yield link.skill.text, link.skill.span
        for argument in link.arguments:
            if isinstance(argument.value, Reference):
                yield argument.value.name, argument.value.span


def _of_condition(condition: Condition) -> Iterator[tuple[str, Span]]:
    for reference in references(condition):
        yield reference.name, reference.span
