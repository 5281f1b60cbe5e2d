"""Find declarations by name, and report unknown names."""

from collections.abc import Mapping
from typing import TypeVar

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.symbols import WORDS, Declaration, correction, suggestion
from rtshcua.model.ir.missions import MissionDecl
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.places import VehicleDecl, ZoneDecl
from rtshcua.model.ir.policies import PolicyDecl, TemplateDecl
from rtshcua.model.ir.signals import SignalDecl
from rtshcua.model.ir.skills import SkillDecl
from rtshcua.model.ir.tests import NominalDecl

D = TypeVar("D", bound=Declaration)


def find_skill(context: CheckContext, name: Name) -> SkillDecl | None:
    """The skill of that name."""
    return _find(context, name, context.symbols.skills, SkillDecl)


def find_zone(context: CheckContext, name: Name) -> ZoneDecl | None:
    """The zone of that name."""
    return _find(context, name, context.symbols.zones, ZoneDecl)


def find_signal(context: CheckContext, name: Name) -> SignalDecl | None:
    """The signal of that name."""
    return _find(context, name, context.symbols.signals, SignalDecl)


def find_policy(context: CheckContext, name: Name) -> PolicyDecl | None:
    """The policy of that name."""
    return _find(context, name, context.symbols.policies, PolicyDecl)


def find_template(context: CheckContext, name: Name) -> TemplateDecl | None:
    """The template of that name."""
    return _find(context, name, context.symbols.templates, TemplateDecl)


def find_nominal(context: CheckContext, name: Name) -> NominalDecl | None:
    """The nominal of that name."""
    return _find(context, name, context.symbols.nominals, NominalDecl)


def find_vehicle(context: CheckContext, name: Name) -> VehicleDecl | None:
    """The vehicle of that name."""
    return _find(context, name, context.symbols.vehicles, VehicleDecl)


def find_flown(context: CheckContext, name: Name) -> MissionDecl | None:
    """The mission of that name in a source."""
    return _find(context, name, context.symbols.missions, MissionDecl)


def find_mission(context: CheckContext, name: str) -> MissionDecl | None:
    """The mission of that name from the command line; a finding has no span."""
    found = context.symbols.missions.get(name)
    if found is None and name not in context.symbols.broken:
        context.report.add(
            codes.UNKNOWN_NAME,
            None,
            f"the mission `{name}` is not declared",
            help=suggestion(name, context.symbols.missions),
        )
    return found


def _find(context: CheckContext, name: Name, table: Mapping[str, D], kind: type[D]) -> D | None:
    found = table.get(name.text)
    if found is not None:
        return found
    if name.text in context.symbols.broken:
        return None
    expected = WORDS[kind]
    other = context.symbols.declared.get(name.text)
    if other is None:
        context.report.add(
            codes.UNKNOWN_NAME,
            name.span,
            f"`{name.text}` is not declared; expected {expected}",
            help=suggestion(name.text, table),
            fix=correction(context.report, name.span, name.text, table),
        )
    else:
        context.report.add(
            codes.WRONG_KIND,
            name.span,
            f"`{name.text}` is {WORDS[type(other)]}; expected {expected}",
            help=suggestion(name.text, table),
            fix=correction(context.report, name.span, name.text, table),
            labels=[(other.name.span, "declared here")],
        )
    return None
