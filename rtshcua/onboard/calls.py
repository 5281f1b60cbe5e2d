"""Formats a step as source text from its bound skill and arguments.

The text in a mission comes from its signer and is not compared with the bound values, so it is never displayed as
the step that flies.
"""

from collections.abc import Sequence

from rtshcua.decision.contracts import cells
from rtshcua.model.decision import Decisive
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import CHOICE, PLACE, ZONE, Parameter
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import unproject
from rtshcua.model.quantity import Dimension, display

_DIMENSIONS = {dimension.value: dimension for dimension in Dimension}


def call(policy: Policy, one: Invocation) -> str:
    """The text of a step: `takeoff(altitude = 9 m)`. The policy must be well-formed; the step need not be."""
    if not 0 <= one.skill < len(policy.contracts) or len(one.arguments) != cells(policy.contracts[one.skill]):
        return "not a call of a skill of the policy"
    contract = policy.contracts[one.skill]
    return f"{contract.name}({arguments(policy, contract.parameters, one.arguments)})"


def arguments(policy: Policy, parameters: Sequence[Parameter], cells: Sequence[int]) -> str:
    """Every argument by name, including those that the compiler filled in."""
    return ", ".join(f"{parameter.name} = {argument(policy, parameter, cells)}" for parameter in parameters)


def argument(policy: Policy, parameter: Parameter, cells: Sequence[int]) -> str:
    """The text of one argument; an argument for which the policy has no name is shown by its number."""
    value = cells[parameter.cell]
    if parameter.kind in (CHOICE, ZONE) and not parameter.low <= value <= parameter.high:
        return f"{value}, out of range"
    if parameter.kind == CHOICE:
        return parameter.labels[value]
    if parameter.kind == ZONE:
        return policy.zones[value].name
    if parameter.kind == PLACE:
        return place(policy, value, cells[parameter.cell + 1])
    return quantity(value, parameter.dimension)


def is_own(policy: Policy, one: Invocation, clause: Decisive) -> bool:
    """Whether a clause is the step's own and not its skill's. Its text then comes from the signer of the mission; its
    code can only tighten the contract.
    """
    if not isinstance(clause, Clause):
        return False
    contract = policy.contracts[one.skill]
    skills = {(each.code, each.text) for each in (*contract.require, *contract.assume, *contract.maintain)}
    return (clause.code, clause.text) not in skills


def quantity(value: int, dimension: str) -> str:
    """The text of a value of a named dimension; a plain number where the name is that of an enumeration."""
    known = _DIMENSIONS.get(dimension)
    return str(value) if known is None else display(value, known)


def place(policy: Policy, x: int, y: int) -> str:
    """The text of a place in local mm."""
    return geographic(*unproject(policy.projection, x, y))


def geographic(latitude: int, longitude: int) -> str:
    """The text of a place in 1e-7 degree."""
    return f"{_degrees(latitude, 'N', 'S')}, {_degrees(longitude, 'E', 'W')}"


def _degrees(value: int, positive: str, negative: str) -> str:
    whole, part = divmod(abs(value), 10_000_000)
    return f"{whole}.{f'{part:07d}'.rstrip('0') or '0'} {negative if value < 0 else positive}"
