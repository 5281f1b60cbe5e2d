"""Before it is ready: the return altitude read and compared, the fence uploaded, read back and switched on."""

import struct
from collections.abc import Callable
from random import Random
from typing import Any

import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.vehicle.ardupilot import ARDUPILOT
from rtshcua.adapters.vehicle.bounds import CEILING_BIT, CIRCLE_BIT, Narrow
from rtshcua.adapters.vehicle.flavour import AutopilotFlavour as Flavour
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.adapters.vehicle.parameters import VehicleParameters
from rtshcua.adapters.vehicle.preflight import Preflight
from rtshcua.adapters.vehicle.px4 import PX4
from rtshcua.codec.frames import Codec
from rtshcua.model.flat.policy import Airspace
from rtshcua.model.flat.zone import HIGHEST, LOWEST, POLYGON, Zone
from virtual.policy import POLICY, PROJECTION, VEHICLE
from virtual.rows import rows

S = 1_000_000
SQUARE = (-100_000, -100_000, 100_000, -100_000, 100_000, 100_000, -100_000, 100_000)
CITY = replace(
    POLICY, vehicle=replace(VEHICLE, return_altitude=30_000), zones=(Zone("city", POLYGON, LOWEST, HIGHEST, SQUARE),),
    declared=1, airspace=Airspace((0,), (), "inside city", 0, 0, 0),
)  # fmt: skip
FLAVOURS = pytest.mark.parametrize("flavour", [PX4, ARDUPILOT], ids=lambda flavour: flavour.name)


#: the parameters that limit the way home, of both autopilots
AS_IT_COMES = {
    "RTL_MIN_DIST": 10.0, "NAV_MC_ALT_RAD": 0.8, "RTL_CONE_SLOPE": 3.0, "RTL_CLIMB_MIN": 0.0, "WPNAV_RADIUS": 200.0,
    "RTL_TYPE": 0.0, "RTL_ALT_TYPE": 0.0, "RALLY_TOTAL": 0.0,
}  # fmt: skip


class Port:
    """A vehicle that accepts parameters and a fence, as its autopilot does. `lose` decides on each frame."""

    def __init__(self, flavour: Flavour, parameters: dict[str, float] | None = None) -> None:
        self.flavour = flavour
        self.legacy = flavour is ARDUPILOT
        usual = {"RTL_RETURN_ALT": 30.0, "RTL_ALT": 3_000.0, "FENCE_TYPE": 3.0, "FENCE_ENABLE": 0.0}
        self.parameters = parameters if parameters is not None else usual | AS_IT_COMES
        self.items: dict[int, Any] = {}
        self.count = 0
        self.result = 0
        self.lose: Callable[[str], bool] = lambda name: False
        self.bend: Callable[[Any], Any] = lambda message: message
        self.heard: list[str] = []
        self.rally: Callable[[], list[Any]] = lambda: [mavlink.MAVLink_mission_count_message(1, 191, 0, 2)]

    def ask(self, number: int) -> Any:
        kind = mavlink.MAVLink_mission_request_message if self.legacy else mavlink.MAVLink_mission_request_int_message
        return kind(1, 191, number, 1)

    def answer(self, m: Any) -> list[Any]:
        name = m.get_type()
        match name:
            case "PARAM_REQUEST_READ" | "PARAM_SET":
                if m.param_id not in self.parameters:
                    return []
                if name == "PARAM_SET":
                    self.parameters[m.param_id] = m.param_value
                return [mavlink.MAVLink_param_value_message(m.param_id.encode(), self.parameters[m.param_id], 9, 1, 0)]
            case "MISSION_COUNT":
                self.count, self.items = m.count, {}
                refusal = mavlink.MAVLink_mission_ack_message(1, 191, self.result, 1)
                return [refusal if self.result else self.ask(0)]
            case "MISSION_ITEM_INT":
                self.items[m.seq] = m
                missing = next((number for number in range(self.count) if number not in self.items), None)
                return [mavlink.MAVLink_mission_ack_message(1, 191, 0, 1) if missing is None else self.ask(missing)]
            case "MISSION_REQUEST_LIST" if m.mission_type == 2:
                return self.rally()
            case "MISSION_REQUEST_LIST":
                return [mavlink.MAVLink_mission_count_message(1, 191, len(self.items), 1)]
            case "MISSION_REQUEST_INT":
                held = self.items[m.seq]
                return [mavlink.MAVLink_mission_item_int_message(
                    1, 191, m.seq, held.frame, held.command, 0, 1, held.param1, 0, 0, 0, held.x, held.y, 0, 1,
                )]  # fmt: skip
        return []

    def settle(self, preflight: Preflight, seconds: int = 60) -> None:
        """Exchange frames until nothing is outstanding, or for a limited time."""
        ours, theirs = Codec(1, 191), Codec(1, 1)
        for tick in range(seconds * 10):
            now_us = tick * S // 10
            waiting = list(preflight.due(1, now_us))
            while waiting:
                (sent,) = theirs.parse(ours.pack(waiting.pop(0)))
                self.heard.append(sent.name)
                if self.lose(sent.name):
                    continue
                for answer in self.answer(sent.message):
                    (received,) = ours.parse(theirs.pack(self.bend(answer)))
                    if not self.lose(received.name):
                        waiting += preflight.take(received.name, received.message, 1, now_us)
            if preflight.unready is None:
                preflight.due(1, now_us)
                return


def preflight(flavour: Flavour, *, fence: bool = True) -> Preflight:
    return Preflight(CITY, flavour, at_home(), fence=fence)


def at_home() -> ObservedVehicle:
    return ObservedVehicle(latitude=PROJECTION.latitude, longitude=PROJECTION.longitude, located=True)


def done(flavour: Flavour) -> str:
    """The notes about a fence that was set; ArduCopter needs parameters for it."""
    text = "its fence was set to the policy's airspace (4 items), and read back"
    switched = "; switched on with `FENCE_TYPE` from 3 to 7 and `FENCE_ENABLE` from 0 to 1, which stays so"
    return text + (switched if flavour is ARDUPILOT else "")


@FLAVOURS
def test_all_is_settled_and_told_once(flavour: Flavour) -> None:
    one, port = preflight(flavour), Port(flavour)
    assert "was not read yet" in (one.unready or "")
    port.settle(one)
    assert one.unready is None
    switched = "; switched on with `FENCE_TYPE` from 3 to 7 and `FENCE_ENABLE` from 0 to 1, which stays so"
    assert one.notes == [
        "its fence was set to the policy's airspace (4 items), and read back"
        + (switched if flavour is ARDUPILOT else "")
    ]
    assert [port.items[number].command for number in range(4)] == [5001] * 4
    assert {item.frame for item in port.items.values()} == {flavour.fence.frame}


def test_arducopters_fence_is_switched_on_and_its_other_kinds_stay_on() -> None:
    port = Port(ARDUPILOT)
    port.settle(preflight(ARDUPILOT))
    assert (port.parameters["FENCE_TYPE"], port.parameters["FENCE_ENABLE"]) == (7.0, 1.0)
    px4 = Port(PX4)
    px4.settle(preflight(PX4))
    assert (px4.parameters["FENCE_TYPE"], px4.parameters["FENCE_ENABLE"]) == (3.0, 0.0)


@rows(("flavour", "parameters", "says"), [
    (PX4, {"RTL_RETURN_ALT": 60.0}, "the vehicle returns at 60 m (`RTL_RETURN_ALT`), and the policy says 30 m: "
                                    "set `RTL_RETURN_ALT` to 30 (for one flight: `--set RTL_RETURN_ALT=30`), "
                                    "or change `return at`"),
    (PX4, {"RTL_RETURN_ALT": 3_000.0}, "the vehicle returns at 3000 m"),
    (PX4, {"RTL_RETURN_ALT": float("nan")}, "the vehicle returns at no number"),
    (PX4, {}, "the vehicle does not report its return altitude (`RTL_RETURN_ALT`)"),
    (ARDUPILOT, {"RTL_ALT": 1_500.0}, "the vehicle returns at 15 m (`RTL_ALT`), and the policy says 30 m: "
                                     "set `RTL_ALT` to 3000"),
    (ARDUPILOT, {"RTL_ALT": 30.0}, "the vehicle returns at 0.3 m"),
    (ARDUPILOT, {"RTL_ALT_M": 15.0}, "the vehicle returns at 15 m (`RTL_ALT_M`), and the policy says 30 m: "
                                     "set `RTL_ALT_M` to 30"),
    (ARDUPILOT, {}, "the vehicle does not report its return altitude (`RTL_ALT` or `RTL_ALT_M`)"),
])  # fmt: skip
def test_different_return_altitude_prevents_readiness(flavour: Flavour, parameters: Any, says: str) -> None:
    one = preflight(flavour, fence=False)
    Port(flavour, parameters).settle(one)
    assert (one.unready or "").startswith(says)


@pytest.mark.parametrize(("flavour", "parameters"), [
    (PX4, {"RTL_RETURN_ALT": 30.004}), (ARDUPILOT, {"RTL_ALT": 3_000.0}), (ARDUPILOT, {"RTL_ALT_M": 30.0}),
])  # fmt: skip
def test_the_same_return_altitude_is_ready(flavour: Flavour, parameters: Any) -> None:
    one = preflight(flavour, fence=False)
    Port(flavour, parameters).settle(one)
    assert one.unready is None


@rows(("flavour", "parameters", "says"), [
    (PX4, {}, None),
    (PX4, {"RTL_MIN_DIST": 10.5}, "set `RTL_MIN_DIST` to at most 10"),
    (PX4, {"NAV_MC_ALT_RAD": 2.5}, "set `NAV_MC_ALT_RAD` to at most 2"),
    (PX4, {"NAV_MC_ALT_RAD": float("nan")}, "(`NAV_MC_ALT_RAD` is nan): set `NAV_MC_ALT_RAD` to at most 2"),
    (ARDUPILOT, {}, None),
    (ARDUPILOT, {"RTL_CONE_SLOPE": 0.0}, None),
    (ARDUPILOT, {"RTL_CONE_SLOPE": 1.0}, "(`RTL_CONE_SLOPE` is 1): set `RTL_CONE_SLOPE` to at least 3"),
    (ARDUPILOT, {"RTL_CLIMB_MIN": 100.0}, "set `RTL_CLIMB_MIN` to at most 0"),
    (ARDUPILOT, {"WPNAV_RADIUS": 500.0}, "set `WPNAV_RADIUS` to at most 200"),
    (PX4, {"RTL_TYPE": 1.0}, "its way home would not be to the proved place (`RTL_TYPE` is 1, a rally point or "
                             "a mission's landing): set `RTL_TYPE` to 0, home, or a rally point that is nearer"),
    (PX4, {"RTL_TYPE": 9.0}, "(`RTL_TYPE` is 9): set `RTL_TYPE` to 0"),
    (ARDUPILOT, {"RTL_ALT_TYPE": 1.0}, "its way home would not be at the proved heights above home (`RTL_ALT_TYPE` "
                                       "is 1, the terrain): set `RTL_ALT_TYPE` to 0, home"),
    (ARDUPILOT, {"RALLY_TOTAL": 2.0}, "(`RALLY_TOTAL` is 2): set `RALLY_TOTAL` to 0, none"),
])  # fmt: skip
def test_parameter_that_changes_way_home_prevents_readiness(
    flavour: Flavour, parameters: dict[str, float], says: str | None
) -> None:
    one = preflight(flavour, fence=False)
    Port(flavour, {"RTL_RETURN_ALT": 30.0, "RTL_ALT": 3_000.0} | AS_IT_COMES | parameters).settle(one)
    assert says is None if one.unready is None else (says or "nothing") in one.unready


def test_return_limits_are_read_under_old_and_new_names() -> None:
    high = replace(CITY, vehicle=replace(CITY.vehicle, return_altitude=60_000))
    new = {"RTL_ALT_M": 60.0, "RTL_CONE_SLOPE": 0.0, "RTL_CLIMB_MIN_M": 0.0, "WP_RADIUS_M": 2.0, "RTL_ALT_TYPE": 0.0}
    for flavour, parameters, ready in (
        (ARDUPILOT, new, True),
        (ARDUPILOT, new | {"WP_RADIUS_M": 2.5}, False),
        (ARDUPILOT, new | {"RTL_CLIMB_MIN_M": 1.0}, False),
        (PX4, {"RTL_RETURN_ALT": 60.0, "NAV_MC_ALT_RAD": 0.8, "RTL_MIN_DIST": 20.0}, True),
        (PX4, {"RTL_RETURN_ALT": 60.0, "NAV_MC_ALT_RAD": 0.8, "RTL_MIN_DIST": 21.0}, False),
    ):
        one = Preflight(high, flavour, at_home(), fence=False)
        Port(flavour, parameters).settle(one)
        assert (one.unready is None) is ready, parameters


def test_limits_of_the_way_home_are_waited_for() -> None:
    one, port = preflight(PX4, fence=False), Port(PX4)
    port.lose = lambda name: name == "PARAM_VALUE" and len(port.heard) > 1
    port.settle(one, 3)
    assert one.unready == "the limit of the way home (`RTL_MIN_DIST`) was not read yet"


@FLAVOURS
def test_a_limit_of_the_way_home_that_stays_silent_is_told_once(flavour: Flavour) -> None:
    one, name = preflight(flavour, fence=False), "RTL_TYPE" if flavour is PX4 else "RTL_ALT_TYPE"
    port = Port(flavour)
    del port.parameters[name]
    port.settle(one)
    assert one.unready is None
    assert [note for note in one.notes if name in note] == [
        f"`{name}` was not answered within 5 s, so the vehicle counts as one without it; if it has the "
        "parameter, its way home may differ from the proved one"
    ]


@pytest.mark.parametrize(("count", "told"), [(1, "1 rally point"), (7, "7 rally points")])
def test_rally_points_of_px4_prevent_readiness(count: int, told: str) -> None:
    """A return leads to the nearest rally point, also with RTL_TYPE 0; no parameter reports them."""
    one, port = preflight(PX4), Port(PX4)
    port.rally = lambda: [mavlink.MAVLink_mission_count_message(1, 191, count, 2)]
    port.settle(one, 10)
    wrong = f"its way home would not be to the proved place (it has {told}): clear them and upload none"
    assert (one.unready, one.unfit) == (wrong, wrong)
    assert "MISSION_ACK" in port.heard, "the vehicle waits for no more questions"
    assert "MISSION_COUNT" not in port.heard, "its fence stays as it is"


def test_arducopter_tells_of_its_rally_points_by_a_parameter_alone() -> None:
    one, port = preflight(ARDUPILOT, fence=False), Port(ARDUPILOT)
    port.settle(one)
    assert "MISSION_REQUEST_LIST" not in port.heard


def test_px4_that_knows_no_rally_points_has_none() -> None:
    one, port = preflight(PX4, fence=False), Port(PX4)
    port.rally = lambda: [mavlink.MAVLink_mission_ack_message(1, 191, 3, 2)]
    port.settle(one, 3)
    assert one.unready is None
    assert not [note for note in one.notes if "rally" in note]


def test_missing_rally_point_count_is_requested_again_and_noted() -> None:
    one, port = preflight(PX4, fence=False), Port(PX4)
    port.rally = list
    port.settle(one, 3)
    assert one.unready == "the vehicle's rally points were not counted yet"
    port.settle(one)
    assert one.unready is None
    (told,) = [note for note in one.notes if "rally" in note]
    assert told.startswith("the number of rally points was not reported within 6 s")
    busy = preflight(PX4, fence=False)
    port.rally = lambda: [mavlink.MAVLink_mission_ack_message(1, 191, 1, 2)]
    port.settle(busy, 3)
    assert busy.unready == "the vehicle's rally points were not counted yet"


@FLAVOURS
def test_a_policy_that_says_no_return_altitude_asks_for_none(flavour: Flavour) -> None:
    one, port = Preflight(POLICY, flavour, at_home(), fence=False), Port(flavour, {})
    port.settle(one)
    one.due(1, 0)
    assert (one.unready, port.heard) == (None, [])
    assert one.notes == ["the vehicle's own fence was left unchanged"]


@FLAVOURS
def test_a_vehicle_that_takes_no_fence_flies_without_and_says_so(flavour: Flavour) -> None:
    one, port = preflight(flavour), Port(flavour)
    port.result = mavlink.MAV_MISSION_UNSUPPORTED
    port.settle(one)
    assert one.unready is None
    assert one.notes == ["the vehicle accepts no fence: only this program watches the policy's airspace"]


@FLAVOURS
def test_refused_or_altered_fence_prevents_readiness(flavour: Flavour) -> None:
    one, port = preflight(flavour), Port(flavour)
    port.result = mavlink.MAV_MISSION_NO_SPACE
    port.settle(one)
    assert one.unready == "the vehicle's fence could not be set: it refuses it (no space) (`--no-fence` flies without)"

    def moved(message: Any) -> Any:
        if message.get_type() == "MISSION_ITEM_INT" and message.seq == 2:
            message.x += 1
        return message

    other, port = preflight(flavour), Port(flavour)
    port.bend = moved
    port.settle(other)
    assert "it holds an item 2 that differs from the one it was sent" in (other.unready or "")

    def shorter(message: Any) -> Any:
        if message.get_type() == "MISSION_COUNT" and message.mission_type == 1:
            message.count = 3
        return message

    third, port = preflight(flavour), Port(flavour)
    port.bend = shorter
    port.settle(third)
    assert "it holds 3 items instead of 4" in (third.unready or "")


@FLAVOURS
def test_request_for_an_unknown_fence_item_is_not_answered(flavour: Flavour) -> None:
    one, port = preflight(flavour), Port(flavour)
    port.ask = lambda number: mavlink.MAVLink_mission_request_int_message(1, 191, 9, 1)  # type: ignore[method-assign]
    port.settle(one)
    assert "it asks for item 9 of 4" in (one.unready or "")


@FLAVOURS
def test_silence_is_not_waited_for_for_ever(flavour: Flavour) -> None:
    one, port = preflight(flavour), Port(flavour)
    port.lose = lambda name: name.startswith("MISSION")
    port.settle(one)
    assert "it does not answer" in (one.unready or "")


def test_fence_without_its_enable_parameter_prevents_readiness() -> None:
    one = preflight(ARDUPILOT)
    Port(ARDUPILOT, {"RTL_ALT": 3_000.0, "FENCE_TYPE": 7.0}).settle(one)
    assert (
        one.unready == "the vehicle's fence could not be switched on: no answer about `FENCE_ENABLE` (see `--no-fence`)"
    )


@FLAVOURS
@pytest.mark.parametrize("seed", range(6))
def test_lost_frames_delay_and_spoil_nothing(flavour: Flavour, seed: int) -> None:
    one, port, chance = preflight(flavour), Port(flavour), Random(seed)
    port.lose = lambda name: chance.random() < 0.25
    port.settle(one, 200)
    assert one.unready is None or "does not" in one.unready
    if one.unready is None:
        assert len(port.items) == 4


@FLAVOURS
def test_failed_upload_is_started_again(flavour: Flavour) -> None:
    one, port = preflight(flavour), Port(flavour)
    for lose in ("MISSION", "PARAM"):
        port.lose = lambda name, lose=lose: name.startswith(lose)
        port.settle(one, 40)
        assert "does not" in (one.unready or "")
    port.lose = lambda name: False
    port.settle(one)
    assert one.unready is None
    switched = "; switched on with `FENCE_TYPE` from 3 to 7 and `FENCE_ENABLE` from 0 to 1, which stays so"
    assert [note for note in one.notes if "rally" not in note] == [
        "its fence was set to the policy's airspace (4 items), and read back"
        + (switched if flavour is ARDUPILOT else "")
    ]


def test_nan_fence_parameter_counts_as_off() -> None:
    one, port = preflight(ARDUPILOT), Port(ARDUPILOT)
    port.parameters["FENCE_TYPE"] = float("nan")
    port.settle(one)
    assert one.unready is None
    assert port.parameters["FENCE_TYPE"] == 4.0


def test_fences_of_other_kinds_are_not_ours() -> None:
    one, port = preflight(PX4), Port(PX4)
    port.settle(one, 0)
    one.due(1, 0)
    mission = mavlink.MAVLink_mission_ack_message(1, 191, 14, 0)
    assert one.take("MISSION_ACK", mission, 1, 0) == []
    port.settle(one)
    assert one.unready is None


@rows("value", [0, 1, 2, 255, 4_001, 2**31 - 1, -1, -5])
def test_px4s_integers_travel_as_their_bytes(value: int) -> None:
    parameters = VehicleParameters(bytewise=True)
    parameters.read("GF_ACTION")
    parameters.due(1, 0)
    raw = struct.unpack("<f", struct.pack("<i", value))[0]
    packed = Codec(1, 1).pack(mavlink.MAVLink_param_value_message(b"GF_ACTION", raw, 6, 1, 0))
    (received,) = Codec(1, 191).parse(packed)
    parameters.take(received.message)
    assert parameters.values["GF_ACTION"] == value
    parameters.write("GF_ACTION", 3.0)
    (sent,) = parameters.due(1, S)
    assert struct.pack("<f", sent.param_value) == struct.pack("<i", 3)


def test_a_parameter_is_set_when_its_echo_says_so() -> None:
    parameters = VehicleParameters(bytewise=False)
    parameters.read("FENCE_ENABLE")
    parameters.due(1, 0)
    for value, settled in ((0.0, True), (0.0, False), (1.0, True)):
        if not settled:
            parameters.write("FENCE_ENABLE", 1.0)
            parameters.due(1, S)
        parameters.take(mavlink.MAVLink_param_value_message(b"FENCE_ENABLE", value, 2, 1, 0))
        assert parameters.is_settled("FENCE_ENABLE") == settled
    parameters.take(mavlink.MAVLink_param_value_message(b"OTHER", 1.0, 2, 1, 0))
    assert "OTHER" not in parameters.values


@FLAVOURS
@pytest.mark.parametrize("what", ["far away", "nowhere", "another return altitude"])
def test_a_fence_is_written_only_where_place_and_return_altitude_are_right(flavour: Flavour, what: str) -> None:
    port, seen = Port(flavour), at_home()
    if what == "far away":
        seen.latitude += 400_000
    elif what == "nowhere":
        seen.located = False
    else:
        port.parameters |= {"RTL_RETURN_ALT": 60.0, "RTL_ALT": 6_000.0}
    one = Preflight(CITY, flavour, seen, fence=True)
    port.settle(one)
    assert not port.items
    says = {"far away": "m from the policy's home", "nowhere": "report its position"}.get(what, "returns at 60 m")
    assert says in (one.unready or "")
    assert (one.astray is None) == (what == "nowhere")
    seen.latitude, seen.located = PROJECTION.latitude, True
    if what != "another return altitude":
        port.settle(one)
        assert len(port.items) == 4
        assert one.unready is None


def test_the_advised_circle_has_room_for_the_noise_of_its_place_and_stays() -> None:
    one = preflight(ARDUPILOT)
    needed = [99, 100, 99, 101, 102, 101]
    advised = [one._advice(Narrow("FENCE_RADIUS", 50.0, each, "from home", CIRCLE_BIT)) for each in needed]
    assert advised == [101, 101, 101, 101, 104, 104]
    assert one._advice(Narrow("FENCE_ALT_MAX", 10.0, 33, "above home", CEILING_BIT)) == 33
