"""Enumerations and signals: the vehicle's reported values, and their MAVLink fields."""

from rtshcua.model.ir.expression import Quantity
from rtshcua.model.ir.node import Name, Node


class Enumerator(Node):
    """A name and its integer on the wire."""

    name: Name
    value: int


class EnumDecl(Node):
    """`enum gps_fix = GPS_FIX_TYPE { fix_2d = 2, fix_3d = 3 }`: ordered by value; `dialect` names the MAVLink enum
    it mirrors.
    """

    name: Name
    dialect: Name | None
    members: tuple[Enumerator, ...]


class Selected(Node):
    """`orientation = 0`: a field of the message, and the raw value, or its name in the dialect, that it must have."""

    field: Name
    value: Name


class SourceDecl(Node):
    """One MAVLink message and the field or fields of the signal.

    Two fields are a pair: latitude and longitude for a `position`, two components for a `speed` (the length of the
    vector). `where` selects messages: those whose fields have these values.
    """

    message: Name
    fields: tuple[Name, ...]
    where: tuple[Selected, ...] = ()


class SignalDecl(Node):
    """`signal battery : ratio = BATTERY_STATUS.battery_remaining unknown at -1 stale after 5 s`.

    `type` is a dimension's name, `position`, `altitude`, or an enumeration. `sources` are alternatives (`or`), of
    which the newest counts. `unknown_at` are raw field values, or enumerators, that mean "unknown". `every`: how often
    the sender reports it, where that is known.
    """

    name: Name
    type: Name
    sources: tuple[SourceDecl, ...]
    unknown_at: tuple[Name, ...]
    every: Quantity | None
    stale_after: Quantity
