"""Scenarios: a mission that flies on the simulated vehicle, its faults, and the expected results."""

from typing import Literal

from rtshcua.model.ir.expression import Condition, Quantity
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.skills import ArgumentValue
from rtshcua.model.ir.tests import Expectation, Quoted


class Seeds(Node):
    """`seeds 1 .. 20`; a single seed is both ends."""

    first: Quantity
    last: Quantity


class FaultCall(Node, kw_only=True):
    """`link_silence(for = 5 s, way = up)`; `name` is as in `model.faults.KINDS`, with `_` for `-`."""

    kind: Literal["fault"] = "fault"
    name: Name
    arguments: tuple[ArgumentValue, ...]


class Charge(Node, kw_only=True):
    """`battery = 80 %`: the charge at the start."""

    kind: Literal["charge"] = "charge"
    name: Name
    value: Quantity


class Begins(Node, kw_only=True):
    """`at "2026-06-01T08:00:00Z"`: UTC at the start of the run, in us since the epoch."""

    kind: Literal["begins"] = "begins"
    utc_us: int


Beginning = Charge | FaultCall | Begins


class Delay(Node):
    """`30 s .. 40 s`: drawn from the seed; a single time is both ends."""

    low: Quantity
    high: Quantity


class AtTimeDecl(Node, kw_only=True):
    """`at 20 s`, after the start of the run."""

    kind: Literal["at-time"] = "at-time"
    delay: Delay


class AfterStepDecl(Node, kw_only=True):
    """`2 s after goto 2`: after the second step of that skill was sent."""

    kind: Literal["after-step"] = "after-step"
    delay: Delay | None
    skill: Name
    number: Quantity | None


class OnConditionDecl(Node, kw_only=True):
    """`2 s after when height > 10 m`: after the condition was true for the first time."""

    kind: Literal["on-condition"] = "on-condition"
    delay: Delay | None
    condition: Condition


Moment = AtTimeDecl | AfterStepDecl | OnConditionDecl


class IncidentDecl(Node):
    """`at 20 s link_silence(for = 5 s)`."""

    moment: Moment
    fault: FaultCall


class DecidesDecl(Node, kw_only=True):
    """`expect fallback return_home because state/violated at "battery > 35 %"`: a decision of the run is like this."""

    kind: Literal["decides"] = "decides"
    decision: Expectation


class Ends(Node, kw_only=True):
    """`expect ends completed, aborted`: in one of these ways."""

    kind: Literal["ends"] = "ends"
    endings: tuple[Name, ...]


class FliesDecl(Node, kw_only=True):
    """`expect flies return_home`, `expect never emergency_land`."""

    kind: Literal["flies"] = "flies"
    skill: Name
    never: bool


class Reacts(Node, kw_only=True):
    """`expect reaction <= 200 ms`."""

    kind: Literal["reacts"] = "reacts"
    most: Quantity


class Keeps(Node, kw_only=True):
    """`expect distance to school >= 20 m`; to `obstacle`, every obstacle."""

    kind: Literal["keeps"] = "keeps"
    place: Name
    least: Quantity


class Lands(Node, kw_only=True):
    """`expect lands in home_field`."""

    kind: Literal["lands"] = "lands"
    zone: Name


Demand = DecidesDecl | Ends | FliesDecl | Reacts | Keeps | Lands


class ScenarioDecl(Node):
    """`scenario "a dropout over the bridge" { flies standard at 20 s link_silence(for = 5 s) expect ends aborted }`."""

    name: Quoted
    mission: Name
    flavours: tuple[Name, ...]  # all autopilots if empty
    seeds: Seeds | None
    start: tuple[Beginning, ...]
    incidents: tuple[IncidentDecl, ...]
    demands: tuple[Demand, ...]
