"""Missions: phases of steps, proposed by someone under a policy for a vehicle."""

from typing import Literal

from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.skills import ArgumentValue


class Step(Node):
    """`goto(bridge_a.entry, altitude = 20 m) on inadmissible abort`."""

    skill: Name
    arguments: tuple[ArgumentValue, ...]
    on_inadmissible: Literal["abort", "hold", "skip"]


class Phase(Node):
    """A named stretch of the mission; its steps run in order."""

    name: Name
    steps: tuple[Step, ...]


class MissionDecl(Node):
    """`mission m under p@7 on quad { intent "..." proposed by agent openclaw for role operator phase ... }`."""

    name: Name
    policy: Name
    policy_version: int
    vehicle: Name
    intent: str | None
    source: Name | None  # agent, operator
    proposer: Name | None  # who: openclaw
    role: Name | None  # on whose behalf
    phases: tuple[Phase, ...]
