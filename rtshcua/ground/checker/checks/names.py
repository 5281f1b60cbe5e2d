"""Check that a name has one meaning."""

from collections.abc import Iterable, Mapping

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.conditions import references
from rtshcua.ground.checker.context import CheckContext, Parametric
from rtshcua.ground.checker.name_scope import PHASE
from rtshcua.ground.checker.symbols import WORDS
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.policies import TemplateDecl
from rtshcua.model.ir.signals import EnumDecl
from rtshcua.model.ir.skills import SkillDecl


def check_names(context: CheckContext) -> None:
    """Report every name that is declared twice, or that shadows another."""
    symbols = context.symbols
    _declared_twice(context)
    enumerators = {member.name.text: enum for enum in symbols.enums.values() for member in enum.members}
    for enum in symbols.enums.values():
        _distinct(context, (member.name for member in enum.members), "enumerator")
        for member in enum.members:
            _hides(context, member.name, "enumerator")
    for skill in symbols.skills.values():
        _owned(context, skill, enumerators)
    for template in symbols.templates.values():
        _owned(context, template, enumerators)
    for mission in symbols.missions.values():
        _distinct(context, (phase.name for phase in mission.phases), "phase")
        _distinct(context, (parameter.name for parameter in mission.parameters), "parameter")
        for parameter in mission.parameters:
            _distinct(context, parameter.choices, "choice")
            if parameter.name.text not in symbols.signals:  # no argument of a step can be a signal
                _hides(context, parameter.name, "parameter")
    for template in symbols.templates.values():
        _ambiguous(context, template)
    _called_phase(context)


def _declared_twice(context: CheckContext) -> None:
    for first, again in context.symbols.duplicates:
        nearer, other, words = again, first, "first declared here"
        if first.span.file != again.span.file:  # the importing file comes first, and must not reuse a name
            nearer, other, words = first, again, "also declared here"
        context.report.add(
            codes.DUPLICATE_NAME,
            nearer.name.span,
            f"`{nearer.name.text}` is declared twice",
            help="rename one of them: a name has one meaning in a program",
            labels=[(other.name.span, f"{words}, as {WORDS[type(other)]}")],
        )


def _owned(context: CheckContext, owner: SkillDecl | TemplateDecl, enumerators: Mapping[str, EnumDecl]) -> None:
    """Check the names of the parameters and sizes of a skill or a template."""
    sizes = owner.sizes if isinstance(owner, SkillDecl) else ()
    _distinct(context, (each.name for each in (*owner.parameters, *sizes)), "parameter" if not sizes else "name")
    for size in sizes:
        _hides(context, size.name, "size")
    for parameter in owner.parameters:
        _hides(context, parameter.name, "parameter")
        enum = enumerators.get(parameter.name.text)
        if enum is not None:
            context.report.add(
                codes.SHADOWED_NAME,
                parameter.name.span,
                f"the parameter `{parameter.name.text}` has the name of a value of `{enum.name.text}`",
                help="give the parameter another name",
                labels=[(enum.name.span, "the enumeration is declared here")],
            )
        _distinct(context, parameter.choices, "choice")
        for choice in parameter.choices:
            _hides(context, choice, "choice")


def _ambiguous(context: CheckContext, template: TemplateDecl) -> None:
    """Report a name in a rule that is both a parameter of the template and an argument."""
    own = {parameter.name.text: parameter for parameter in template.parameters}
    for rule in template.rules:
        skills = [context.symbols.skills[name.text] for name in rule.skills if name.text in context.symbols.skills]
        for reference in () if rule.when is None else references(rule.when):
            owner = next((skill for skill in skills if reference.name in context.arguments(skill)), None)
            if reference.name in own and owner is not None:
                context.report.add(
                    codes.SHADOWED_NAME,
                    reference.span,
                    f"`{reference.name}` is both a parameter of the template and an argument of `{owner.name.text}`",
                    help="give the template's parameter another name",
                    labels=[
                        (own[reference.name].span, "the template's"),
                        (context.arguments(owner)[reference.name].declaration.span, f"that of `{owner.name.text}`"),
                    ],
                )


def _called_phase(context: CheckContext) -> None:
    """Report a value named `phase`, which conditions use for the mission's phase."""
    symbols = context.symbols
    names = [signal.name for signal in symbols.signals.values()] + [zone.name for zone in symbols.zones.values()]
    names += [member.name for enum in symbols.enums.values() for member in enum.members]
    owners: list[Parametric] = [*symbols.skills.values(), *symbols.templates.values(), *symbols.missions.values()]
    names += [size.name for skill in symbols.skills.values() for size in skill.sizes]
    for owner in owners:
        for parameter in owner.parameters:
            names += [parameter.name, *parameter.choices]
    for name in names:
        if name.text == PHASE:
            context.report.add(
                codes.SHADOWED_NAME,
                name.span,
                f"`{PHASE}` is reserved for the mission's phase",
                help="give it another name",
            )


def _distinct(context: CheckContext, names: Iterable[Name], what: str) -> None:
    """Report the second of two equal names in one list."""
    seen: dict[str, Name] = {}
    for name in names:
        first = seen.setdefault(name.text, name)
        if first is not name:
            context.report.add_twice(
                codes.DUPLICATE_NAME, name.span, f"the {what} `{name.text}`", "declared", first.span
            )


def _hides(context: CheckContext, name: Name, what: str) -> None:
    """Report a name inside a declaration that is also the name of a declaration."""
    declaration = context.symbols.declared.get(name.text)
    if declaration is not None:
        context.report.add(
            codes.SHADOWED_NAME,
            name.span,
            f"the {what} `{name.text}` has the name of {context.symbols.kind_of(name.text)}",
            help=f"give the {what} another name",
            labels=[(declaration.name.span, "declared here")],
        )
