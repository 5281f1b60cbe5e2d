"""A link of a chain, ready to be chosen."""

from typing import NamedTuple

import msgspec

from rtshcua.decision.evaluate import Condition
from rtshcua.decision.values import Value
from rtshcua.decision.volume import Planner
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Link

#: a clause, and the function that evaluates it
Guards = tuple[tuple[Clause, Condition], ...]


class Choice(msgspec.Struct, frozen=True):
    """A link and its index in the chain, or DEGRADE (`links`)."""

    index: int
    link: Link


class PreparedLink(NamedTuple):
    """A link, its arguments as values, its skill's `require`, its kind of motion and what it may fly through."""

    link: Link
    arguments: tuple[Value, ...]
    require: Guards
    motion: int
    planner: Planner
