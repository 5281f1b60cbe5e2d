"""The airspace as a fence: never narrower than the airspace, with a note for each omitted part."""

from typing import Any

import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.vehicle.ardupilot import ARDUPILOT
from rtshcua.adapters.vehicle.fence import (
    EXCLUDE_CIRCLE,
    EXCLUDE_VERTEX,
    INCLUDE_CIRCLE,
    INCLUDE_VERTEX,
    Fence,
    Upload,
    UploadState,
    fence_of,
)
from rtshcua.adapters.vehicle.px4 import PX4
from rtshcua.model.flat.policy import Airspace
from rtshcua.model.flat.zone import AREA, CIRCLE, HIGHEST, LOWEST, POLYGON, Zone, project
from virtual.policy import POLICY, PROJECTION

M = 1_000
SQUARE = (-100 * M, -100 * M, 100 * M, -100 * M, 100 * M, 100 * M, -100 * M, 100 * M)
SMALL = tuple(each // 2 for each in SQUARE)
HOLE = (10 * M, 10 * M, 10 * M, 20 * M, 20 * M, 20 * M, 20 * M, 10 * M)  # clockwise
FLAVOURS = pytest.mark.parametrize("flavour", [PX4, ARDUPILOT], ids=lambda flavour: flavour.name)


def zone(name: str = "city", shape: int = POLYGON, data: tuple[int, ...] = SQUARE, **more: Any) -> Zone:
    return Zone(name, shape, **{"floor": LOWEST, "ceiling": HIGHEST, "data": data, **more})


def fence(flavour: Any, inside: list[Zone], outside: list[Zone] | None = None) -> Fence:
    zones = (*inside, *(outside or []))
    numbers = tuple(range(len(zones)))
    airspace = Airspace(numbers[: len(inside)], numbers[len(inside) :], "airspace", 0, 0, 0)
    return fence_of(replace(POLICY, zones=zones, declared=len(zones), airspace=airspace), flavour.fence)


def rings(made: Fence) -> list[tuple[int, list[tuple[int, int]]]]:
    """Command and corners in local mm, ring by ring."""
    found: list[tuple[int, list[tuple[int, int]]]] = []
    left = 0.0
    for item in made.items:
        if not left:
            left = item.parameter if item.command in (INCLUDE_VERTEX, EXCLUDE_VERTEX) else 1
            found.append((item.command, []))
        found[-1][1].append(project(PROJECTION, item.latitude, item.longitude))
        left -= 1
    return found


def points(data: tuple[int, ...]) -> list[tuple[int, int]]:
    return list(zip(data[::2], data[1::2], strict=True))


def near(corners: list[tuple[int, int]], data: tuple[int, ...]) -> bool:
    return len(corners) == len(data) // 2 and all(
        abs(x - x0) <= 12 and abs(y - y0) <= 12 for (x, y), (x0, y0) in zip(corners, points(data), strict=True)
    )


@FLAVOURS
def test_a_polygon_is_included_and_another_excluded(flavour: Any) -> None:
    made = fence(flavour, [zone()], [zone("school", data=SMALL)])
    (include, corners), (exclude, others) = rings(made)
    assert (include, exclude) == (INCLUDE_VERTEX, EXCLUDE_VERTEX)
    assert near(corners, SQUARE)
    assert near(others, SMALL)
    assert made.left_out == ()


@FLAVOURS
def test_circles_are_rounded_away_from_the_airspace(flavour: Any) -> None:
    radius = 80_123
    circle = (0, 0, radius * radius)
    included, excluded = fence(flavour, [zone("meadow", CIRCLE, circle)], [zone("school", CIRCLE, circle)]).items
    assert (included.command, excluded.command) == (INCLUDE_CIRCLE, EXCLUDE_CIRCLE)
    assert included.parameter == 80.13
    assert excluded.parameter == 80.12


@FLAVOURS
def test_heights_and_times_of_the_inside_are_left_out_and_said(flavour: Any) -> None:
    made = fence(flavour, [zone(ceiling=120 * M, daily=(1, 2))])
    assert len(made.items) == 4
    assert made.left_out == ("the heights of `city`", "the times of `city`")


@FLAVOURS
@pytest.mark.parametrize(("more", "why"), [
    ({"ceiling": 50 * M}, "it may be flown over or under"),
    ({"floor": 10 * M}, "it may be flown over or under"),
    ({"dates": (1, 2)}, "it applies at times only"),
    ({"shape": AREA, "data": (2, 4, 4, *SQUARE, *HOLE)}, "it has holes"),
])  # fmt: skip
def test_zones_limited_in_time_or_height_are_not_excluded(flavour: Any, more: Any, why: str) -> None:
    made = fence(flavour, [zone()], [zone("school", **more)])
    assert len(made.items) == 4
    assert made.left_out == (f"`school`: {why}",)


@FLAVOURS
def test_a_hole_of_the_inside_is_an_exclusion(flavour: Any) -> None:
    made = fence(flavour, [zone("field", AREA, (2, 4, 4, *SQUARE, *HOLE))])
    assert [(command, len(corners)) for command, corners in rings(made)] == [(INCLUDE_VERTEX, 4), (EXCLUDE_VERTEX, 4)]
    assert made.left_out == ()


def test_fence_has_both_inclusion_zones_if_the_autopilot_intersects() -> None:
    both = fence(ARDUPILOT, [zone(), zone("part", data=SMALL)])
    assert len(both.items) == 8
    smallest = fence(PX4, [zone(), zone("part", data=SMALL)])
    assert near(rings(smallest)[0][1], SMALL)
    assert len(smallest.items) == 4
    assert smallest.left_out == ("`city`, because this autopilot joins inclusion zones instead of intersecting them",)


def test_a_zone_of_two_parts_is_there_where_inclusions_are_joined() -> None:
    shifted = tuple(each + 500 * M for each in SQUARE)
    parts = zone("islands", AREA, (2, 4, 4, *SQUARE, *shifted))
    assert len(fence(PX4, [parts]).items) == 8
    none = fence(ARDUPILOT, [parts])
    assert none.items == ()
    assert "2 parts" in none.left_out[0]


def test_policy_without_airspace_has_no_fence() -> None:
    assert fence_of(POLICY, PX4.fence) == Fence((), ("the policy has no airspace",))


def acknowledged(result: int) -> Any:
    return mavlink.MAVLink_mission_ack_message(255, 191, result, 1)


def test_an_item_that_came_twice_ends_no_upload() -> None:
    """A slow vehicle repeats its request, gets two answers, and reports `invalid sequence` for the second."""
    items = fence(ARDUPILOT, [zone()]).items
    upload = Upload(items, ARDUPILOT.fence.frame)
    upload.due(1, 0)

    def takes(message: Any) -> list[str]:
        return [each.get_type() for each in upload.take(message.get_type(), message, 1, 0)]

    for number in range(len(items)):
        for _ in range(2):
            asked = mavlink.MAVLink_mission_request_message(255, 191, number, 1)
            assert takes(asked) == ["MISSION_ITEM_INT"]
        assert takes(mavlink.MAVLink_mission_ack_message(255, 191, mavlink.MAV_MISSION_INVALID_SEQUENCE, 1)) == []
    assert takes(mavlink.MAVLink_mission_ack_message(255, 191, mavlink.MAV_MISSION_ACCEPTED, 1)) == [
        "MISSION_REQUEST_LIST"
    ]
    assert upload.state is UploadState.COUNTING
