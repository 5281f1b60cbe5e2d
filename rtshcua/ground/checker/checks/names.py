"""E0202, E0203: one name, one meaning."""

from collections.abc import Iterable

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.context import Context
from rtshcua.model.ir.node import Name


def check(context: Context) -> None:
    """Report every name that is declared twice, or that hides another."""
    symbols, report = context.symbols, context.report
    for first, again in symbols.duplicates:
        kind = symbols.kind_of(first.name.text)
        report.add(
            codes.DUPLICATE_NAME,
            again.name.span,
            f"`{again.name.text}` is declared twice",
            help="give it another name: one name has one meaning, whatever it is declared as",
            labels=[(first.name.span, f"first declared here, as {kind}")],
        )
    enumerators = {member.name.text: enum for enum in symbols.enums.values() for member in enum.members}
    for enum in symbols.enums.values():
        _distinct(context, (member.name for member in enum.members), "enumerator")
        for member in enum.members:
            _hides(context, member.name, "enumerator")
    for skill in symbols.skills.values():
        _distinct(context, (parameter.name for parameter in skill.parameters), "parameter")
        for parameter in skill.parameters:
            _hides(context, parameter.name, "parameter")
            enum_of_name = enumerators.get(parameter.name.text)
            if enum_of_name is not None:
                report.add(
                    codes.SHADOWED_NAME,
                    parameter.name.span,
                    f"the parameter `{parameter.name.text}` has the name of a value of `{enum_of_name.name.text}`",
                    help="give the parameter another name",
                    labels=[(enum_of_name.name.span, "the enumeration is declared here")],
                )
            _distinct(context, parameter.choices, "choice")
            for choice in parameter.choices:
                _hides(context, choice, "choice")
    for mission in symbols.missions.values():
        _distinct(context, (phase.name for phase in mission.phases), "phase")


def _distinct(context: Context, names: Iterable[Name], what: str) -> None:
    """Report the second of two equal names in one list."""
    seen: dict[str, Name] = {}
    for name in names:
        first = seen.setdefault(name.text, name)
        if first is not name:
            context.report.add(
                codes.DUPLICATE_NAME,
                name.span,
                f"the {what} `{name.text}` is declared twice",
                labels=[(first.span, "first declared here")],
            )


def _hides(context: Context, name: Name, what: str) -> None:
    """Report a name within a declaration that is also a declaration's."""
    declaration = context.symbols.declared.get(name.text)
    if declaration is not None:
        context.report.add(
            codes.SHADOWED_NAME,
            name.span,
            f"the {what} `{name.text}` has the name of {context.symbols.kind_of(name.text)}",
            help=f"give the {what} another name",
            labels=[(declaration.name.span, "declared here")],
        )
