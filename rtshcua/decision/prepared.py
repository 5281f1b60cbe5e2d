"""A policy and an invocation as they are held between `prepare` and the decisions on them."""

from dataclasses import dataclass
from typing import NamedTuple

from rtshcua.decision.compiler import Compiler
from rtshcua.decision.energy import Energy
from rtshcua.decision.evaluate import Condition, Environment, Tables
from rtshcua.decision.link import Choice, Guards, PreparedLink
from rtshcua.decision.rules import Candidates, RuleIndex
from rtshcua.decision.truth import Truth
from rtshcua.decision.values import Sets, Value
from rtshcua.decision.volume import Planner
from rtshcua.decision.zones import PreparedZone
from rtshcua.model.flat.contract import Parameter
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Airspace, Policy
from rtshcua.model.flat.situation import Now, State


class PreparedAirspace(NamedTuple):
    """The airspace and its zones."""

    airspace: Airspace
    inside: tuple[PreparedZone, ...]
    outside: tuple[PreparedZone, ...]


class Limit(NamedTuple):
    """What a state slot may hold: no older than `stale_us`, no further from 0 than `most`."""

    stale_us: int
    most: int


class PreparedMonitor(NamedTuple):
    """A temporal monitor: its kind, how far back it looks, and the condition that it looks at."""

    kind: int
    window_us: int
    condition: Condition


class Seen(NamedTuple):
    """A single situation, as sets of values, and as conditions read it, by arguments and phase; and what was found in
    it: which links may fly, by their phase, and which would be chosen for an invocation, after the link of which index.
    """

    state: State
    now: Now
    sets: Sets
    environments: list[Environment]
    links: list[tuple[PreparedLink, int, Truth]]
    choices: list[tuple["PreparedInvocation", int, Choice | None]]


class Latest:
    """The last single situation that was asked about: in the same one, the answers are the same."""

    __slots__ = ("seen",)

    def __init__(self) -> None:
        self.seen: Seen | None = None


@dataclass(frozen=True, slots=True, eq=False)
class PreparedPolicy:
    """A policy that was found well-formed, compiled. `limits` has one entry a slot; `monitors` are in order.

    `latest` is remembered to be quick: no answer depends on it.
    """

    policy: Policy
    compiler: Compiler
    tables: Tables
    limits: tuple[Limit, ...]
    rules: RuleIndex
    airspace: PreparedAirspace | None
    contingency: tuple[PreparedLink, ...]
    still: Planner  # plans to stay: the present place with its error
    monitors: tuple[PreparedMonitor, ...]
    latest: Latest


@dataclass(frozen=True, slots=True, eq=False)
class PreparedInvocation:
    """An invocation that was found well-formed, compiled under `policy`.

    `misfit` is the first parameter whose argument is out of range; `reads` are the slots that a decision may read, each
    with the age in us at which it is stale. `phase` is the number of its mission phase among the policy's phase names,
    -1 if it is none of them; `rests_us` how long the observation that a decision rests on stands for the moments after;
    `lasts_us` the longest that it may fly (`lasting.longest`).
    """

    invocation: Invocation
    policy: PreparedPolicy
    arguments: tuple[Value, ...]
    misfit: Parameter | None
    require: Guards
    assume: Guards
    maintain: Guards
    chain: tuple[PreparedLink, ...]
    candidates: Candidates
    planner: Planner
    energy: Energy
    reads: tuple[tuple[int, int], ...]
    phase: int
    rests_us: int
    lasts_us: int
