"""Zones and vehicles."""

from typing import Annotated, Literal

from pydantic import Field

from rtshcua.model.ir.expression import Coordinates, Quantity
from rtshcua.model.ir.node import Name, Node


class Circle(Node):
    """All points nearer to `center` than `radius`."""

    kind: Literal["circle"] = "circle"
    center: Coordinates
    radius: Quantity


class Polygon(Node):
    """A simple polygon by its corners, WGS 84, in either direction, not closed by a repeated corner."""

    kind: Literal["polygon"] = "polygon"
    corners: tuple[Coordinates, ...]


class ZoneDecl(Node):
    """`zone bridge_a = polygon(...) floor 0 m ceiling 60 m above home entry 47.39 N, 8.54 E`."""

    name: Name
    shape: Annotated[Circle | Polygon, Field(discriminator="kind")]
    floor: Quantity | None
    ceiling: Quantity | None
    entry: Coordinates | None


class VehicleDecl(Node):
    """What the checks, the simulation and "wrong vehicle" need to know of one aircraft; signed with the policy.

    `endurance` is the hover time of a full battery, `reserve` the charge that must remain after landing at home,
    `within` how far the real home may lie from the declared one, `utc_offset` the local time's distance from UTC.
    """

    name: Name
    identity: str
    home: Coordinates
    within: Quantity
    speed: Quantity
    climb: Quantity
    position_error: Quantity
    endurance: Quantity
    reserve: Quantity
    utc_offset: Quantity | None
