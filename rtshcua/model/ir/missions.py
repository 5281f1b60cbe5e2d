"""Missions: phases of steps, proposed by someone under a policy for a vehicle."""

from typing import Literal

from rtshcua.model.ir.expression import Quantity
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.skills import ArgumentValue, ClauseDecl, ParameterDecl


class Overrides(Node):
    """The block after a step. It may only tighten the contract: shorter times, a larger energy reserve, fewer phases,
    further clauses and kinds of evidence. None or an empty tuple: as in the skill.
    """

    deadline: Quantity | None = None
    validity: Quantity | None = None
    duration: Quantity | None = None
    grace: Quantity | None = None
    energy: Quantity | None = None
    phases: tuple[Name, ...] = ()
    require: tuple[ClauseDecl, ...] = ()
    assume: tuple[ClauseDecl, ...] = ()
    maintain: tuple[ClauseDecl, ...] = ()
    record: tuple[Name, ...] = ()

    @property
    def clauses(self) -> tuple[ClauseDecl, ...]:
        """The step's own clauses."""
        return (*self.require, *self.assume, *self.maintain)


class Step(Node, kw_only=True):
    """`goto(bridge_a.entry, altitude = 20 m) on inadmissible abort { deadline 2 s }`."""

    kind: Literal["step"] = "step"
    skill: Name
    arguments: tuple[ArgumentValue, ...]
    on_inadmissible: Literal["abort", "hold", "skip", "replan"]
    overrides: Overrides | None = None


class Repeat(Node, kw_only=True):
    """`repeat 3 { ... }`: its items in order, repeated. Elaboration unrolls it."""

    kind: Literal["repeat"] = "repeat"
    count: Quantity
    items: tuple["Item", ...]


Item = Step | Repeat


class Phase(Node):
    """A named stretch of the mission; its steps run in order. After elaboration, all of them are steps."""

    name: Name
    items: tuple[Item, ...]

    @property
    def steps(self) -> tuple[Step, ...]:
        """The steps of an elaborated phase."""
        return tuple(item for item in self.items if isinstance(item, Step))


class MissionDecl(Node):
    """`mission m under p@7 on quad { intent "..." proposed by agent openclaw for role operator phase ... }`."""

    name: Name
    policy: Name
    policy_version: int
    vehicle: Name
    intent: str | None
    source: Name | None  # source: agent, operator
    proposer: Name | None  # name of the proposer: openclaw
    role: Name | None  # role on whose behalf it proposes
    phases: tuple[Phase, ...]
    parameters: tuple[
        ParameterDecl, ...
    ] = ()  # `mission m(area: zone, height: altitude in 5 m .. 30 m = 20 m) under ...`
    most_time: Quantity | None = None  # `lasts at most 20 min`
    most_energy: Quantity | None = None  # `energy at most 60 %`
    most_steps: int | None = None  # `steps at most 40`
