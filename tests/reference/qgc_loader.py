"""What QGroundControl demands of a plan when it loads one, written after its documentation and its source: required
keys and their types (`MissionController::_loadJsonMissionFileV2`, `MissionItem::load`, `SimpleMissionItem::load`,
`GeoFenceController::load`). Other keys are ignored (`JsonHelper::validateKeys`).
"""

from typing import Any

Number = (int, float)


def _keys(found: dict[str, Any], **types: Any) -> None:
    for name, wanted in types.items():
        assert name in found, f"{name} is missing"
        assert isinstance(found[name], wanted), f"{name} is {found[name]!r}"
        assert wanted is bool or not isinstance(found[name], bool)


def _place(found: Any, length: int) -> None:
    assert isinstance(found, list)
    assert len(found) == length
    assert all(each is None or isinstance(each, Number) for each in found)
    assert -90 <= found[0] <= 90
    assert -180 <= found[1] <= 180


def load(plan: dict[str, Any]) -> list[dict[str, Any]]:
    """Assert that QGroundControl loads a plan; return its items."""
    _keys(plan, fileType=str, version=int, groundStation=str, mission=dict, geoFence=dict, rallyPoints=dict)
    assert (plan["fileType"], plan["version"]) == ("Plan", 1)
    mission = plan["mission"]
    _keys(
        mission, version=int, firmwareType=int, vehicleType=int, cruiseSpeed=Number, hoverSpeed=Number,
        globalPlanAltitudeMode=int, items=list, plannedHomePosition=list,
    )  # fmt: skip
    assert mission["version"] == 2
    _place(mission["plannedHomePosition"], 3)
    assert mission["items"], "a plan must contain at least one item"
    for number, item in enumerate(mission["items"], start=1):
        _item(item, number)
    fence, rally = plan["geoFence"], plan["rallyPoints"]
    _keys(fence, version=int, circles=list, polygons=list)
    assert fence["version"] == 2
    for each in fence["circles"]:
        _keys(each, version=int, inclusion=bool, circle=dict)
        _keys(each["circle"], center=list, radius=Number)
        assert each["version"] == 1
        _place(each["circle"]["center"], 2)
    for each in fence["polygons"]:
        _keys(each, version=int, inclusion=bool, polygon=list)
        assert each["version"] == 1
        assert len(each["polygon"]) >= 3
        for corner in each["polygon"]:
            _place(corner, 2)
    _keys(rally, version=int, points=list)
    assert rally["version"] == 2
    for each in rally["points"]:
        _place(each, 3)
    items: list[dict[str, Any]] = mission["items"]
    return items


def _item(item: dict[str, Any], number: int) -> None:
    _keys(item, type=str, frame=int, command=int, params=list, autoContinue=bool, doJumpId=int)
    assert item["type"] == "SimpleItem"
    assert "coordinate" not in item, "the older key is appended to the parameters, which are then too many"
    assert item["doJumpId"] == number
    assert len(item["params"]) == 7
    assert all(each is None or isinstance(each, Number) for each in item["params"])
    if "AltitudeMode" in item or "Altitude" in item or "AMSLAltAboveTerrain" in item:
        _keys(item, AltitudeMode=int, Altitude=Number)
        assert item["AMSLAltAboveTerrain"] is None, "newer versions demand null, older ones a number or null"
        assert item["Altitude"] == item["params"][6]
