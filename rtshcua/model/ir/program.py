"""A parsed file, and a program: a file and the closure of its imports."""

from rtshcua.model.ir.missions import MissionDecl
from rtshcua.model.ir.node import Node
from rtshcua.model.ir.places import VehicleDecl, ZoneDecl
from rtshcua.model.ir.policies import PolicyDecl, RoleDecl, TemplateDecl
from rtshcua.model.ir.scenarios import ScenarioDecl
from rtshcua.model.ir.signals import EnumDecl, SignalDecl
from rtshcua.model.ir.skills import SizesDecl, SkillDecl
from rtshcua.model.ir.tests import NominalDecl, TestDecl


class Import(Node):
    """`import "../skills/goto.rts"`, relative to the importing file."""

    path: str


class Unit(Node):
    """All declarations of one file, in source order by kind."""

    file: str
    imports: tuple[Import, ...]
    enums: tuple[EnumDecl, ...]
    signals: tuple[SignalDecl, ...]
    zones: tuple[ZoneDecl, ...]
    vehicles: tuple[VehicleDecl, ...]
    skills: tuple[SkillDecl, ...]
    policies: tuple[PolicyDecl, ...]
    missions: tuple[MissionDecl, ...]
    templates: tuple[TemplateDecl, ...] = ()
    nominals: tuple[NominalDecl, ...] = ()
    tests: tuple[TestDecl, ...] = ()
    scenarios: tuple[ScenarioDecl, ...] = ()
    roles: tuple[RoleDecl, ...] = ()
    sizes: tuple[SizesDecl, ...] = ()
