"""The doctor with the simulated vehicle in explicit time: a healthy vehicle, and each fault that stops a mission."""

import dataclasses
import itertools
from collections.abc import Callable
from typing import Any

import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.doctor.diagnosis import (
    MissionVerdict,
    VehicleFinding,
    _setting,
    diagnose,
    settings_told,
    settled,
    settling,
    told_apart,
)
from rtshcua.adapters.doctor.examination import ExaminingDriver
from rtshcua.adapters.doctor.settings import SETTINGS
from rtshcua.adapters.utc import TimeSources
from rtshcua.adapters.vehicle.bounds import FlightReach
from rtshcua.codec.frames import Codec
from rtshcua.mavlink.parameters import bits_of
from rtshcua.mavlink.signing import SignedLink, SigningState
from rtshcua.model.faults import GpsLoss, LinkLoss, MessageSilence
from rtshcua.model.flat.policy import Policy, Speeds
from rtshcua.model.flat.signal import CELL, DRAIN, NUMBER, Signal, SignalSource
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.onboard.rehearsal import unheard
from rtshcua.simulation.config import EQUIPPED, AutopilotKind, Boot, Equipment, OtherBattery, Purpose, SimulationConfig
from rtshcua.simulation.place import HomePosition
from rtshcua.virtual.vehicle import SECOND, VirtualClock, VirtualVehicle
from virtual import case
from virtual.rows import rows

KEY = bytes(range(32))
MISSION = case.mission(case.short_steps())
FLAVOURS = pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
Prepare = Callable[[VirtualVehicle], None]


def examine(
    config: SimulationConfig,
    policy: Policy | None = None,
    *,
    prepare: Prepare = lambda _: None,
    seconds: int = 14,
    utc_error_us: int | None = 1_000,
    meant: dict[str, int] | None = None,
    vehicle_counts: bool = True,
    stated_us: int | None = None,
) -> dict[str, VehicleFinding]:
    """The findings after so many seconds, by slug; the worst of several with one slug. An ArduCopter acts on a low
    battery, as its owner set it, unless `config` says otherwise.
    """
    if config.flavour is AutopilotKind.ARDUPILOT and "BATT_FS_LOW_ACT" not in dict(config.parameters):
        config = dataclasses.replace(config, parameters=(*config.parameters, ("BATT_FS_LOW_ACT", 2.0)))
    policy = policy or case.policy()
    clock = VirtualClock()
    vehicle = VirtualVehicle(policy, config, clock, fence=False)
    vehicle.driver = ExaminingDriver(policy, clock, vehicle.frames, steps=MISSION.invocations, meant=meant)
    prepare(vehicle)
    while clock.elapsed_us < seconds * SECOND:
        vehicle.poll(clock.now().monotonic_us, SECOND)
    found: dict[str, VehicleFinding] = {}
    time = TimeSources(utc_error_us, vehicle=vehicle_counts, stated_us=stated_us)
    for each in diagnose(vehicle.driver, policy, MISSION, keyed=False, time=time):
        if each.slug not in found or each.verdict is MissionVerdict.STOP:
            found[each.slug] = each
    return found


def stops(found: dict[str, VehicleFinding]) -> set[str]:
    return {slug for slug, each in found.items() if each.verdict is MissionVerdict.STOP}


@FLAVOURS
def test_healthy_vehicle_has_no_findings(flavour: str) -> None:
    sent: list[bytes] = []

    def watch(vehicle: VirtualVehicle) -> None:
        vehicle.lose = lambda frame: bool(sent.append(frame))

    found = examine(case.simulated(flavour), prepare=watch)
    assert stops(found) == set()
    assert found["autopilot/version"].verdict is MissionVerdict.OK
    assert found["link/answers"].verdict is found["link/round-trip"].verdict is MissionVerdict.OK
    assert found["link/streams"].verdict is MissionVerdict.OK
    assert "bytes/s requested" in found["link/streams"].found
    assert found["link/round-trip"].found == "0 ms round trip; the vehicle's clock is known to 3 ms"
    assert found["signal/battery"].found.startswith("`battery`: BATTERY_STATUS every ")
    assert {slug for slug in found if slug.startswith("settings/")} >= {
        "px4": {"settings/gf_action", "settings/nav_dll_act"},
        "ardupilot": {"settings/fs_ekf_action", "settings/batt_fs_low_act"},
    }[flavour]
    assert found["link/signing"].verdict is MissionVerdict.WARN
    names = [each.message for frame in sent for each in Codec(0, 0).parse(frame)]
    assert {each.get_type() for each in names} == {"HEARTBEAT", "COMMAND_LONG", "PARAM_REQUEST_READ", "TIMESYNC"}
    asked = {each.command for each in names if each.get_type() == "COMMAND_LONG"}
    own_checks = {mavlink.MAV_CMD_RUN_PREARM_CHECKS}  # the second check reports the reason
    assert asked - own_checks == {mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("flavour", "parameters", "slug", "needed", "advice"),
    [
        ("ardupilot", {"FENCE_RADIUS": 5.0}, "settings/fence_radius", "at least ", "set `FENCE_RADIUS` to "),
        ("ardupilot", {"FENCE_ALT_MAX": 5.0}, "settings/fence_alt_max", "at least ", "set `FENCE_ALT_MAX` to "),
        ("px4", {"GF_MAX_HOR_DIST": 5.0}, "settings/gf_max_hor_dist", "at least ", "set `GF_MAX_HOR_DIST` to "),
        ("px4", {"RTL_TYPE": 1.0}, "settings/rtl_type", "0, home", "set `RTL_TYPE` to 0"),
        ("ardupilot", {"RTL_ALT_TYPE": 1.0}, "settings/rtl_alt_type", "0, home", "set `RTL_ALT_TYPE` to 0"),
        ("ardupilot", {"WPNAV_SPEED": 5_000.0}, "settings/wpnav_speed", "at most 12 m/s", "to 1200"),
        ("px4", {"MPC_Z_VEL_MAX_UP": 8.0}, "settings/mpc_z_vel_max_up", "at most ", "set `MPC_Z_VEL_MAX_UP` to "),
        ("px4", {"GF_ACTION": 0.0}, "settings/gf_action", "hold", "second protection; set `GF_ACTION` to 2"),
        ("ardupilot", {"FS_EKF_ACTION": 0.0}, "settings/fs_ekf_action", "land", "set `FS_EKF_ACTION` to 1"),
    ],
)
def test_interfering_parameter_names_need_and_remedy(
    flavour: str, parameters: dict[str, float], slug: str, needed: str, advice: str
) -> None:
    found = examine(case.simulated(flavour, parameters=tuple(parameters.items())))
    finding = found[slug]
    assert finding.verdict is MissionVerdict.WARN
    assert finding.needed.startswith(needed)
    assert advice in finding.advice
    name = next(iter(parameters))
    assert name in finding.found
    beyond = name in ("FENCE_RADIUS", "FENCE_ALT_MAX", "GF_MAX_HOR_DIST")
    assert ("mission/unready" in stops(found)) is beyond, "where it cannot fly at all, that is said"


SPEEDS = Speeds(
    cruise=5_000, climb=1_500, descent=1_000, landing=500, landing_below=10_000, homeward=6_000, acceleration=1_000,
    air=12_000, wind=5_000, flight_us=1_000 * SECOND,
)  # fmt: skip
#: a value that is too slow, in the units of the parameter, and the required value
SLOW = {
    "px4": {
        "MPC_XY_CRUISE": (5.5, 6), "MPC_Z_VEL_MAX_UP": (1, 1.5), "MPC_Z_VEL_MAX_DN": (0.5, 1),
        "MPC_TKO_SPEED": (1, 1.5), "MPC_LAND_SPEED": (0.3, 0.5), "MPC_LAND_ALT1": (20, 10), "MPC_ACC_HOR": (1, 1.5),
    },
    "ardupilot": {
        "WPNAV_SPEED": (450, 500), "WPNAV_SPEED_UP": (100, 150), "WPNAV_SPEED_DN": (50, 100), "WPNAV_ACCEL": (50, 100),
        "RTL_SPEED": (550, 600), "LAND_SPEED": (30, 50), "LAND_ALT_LOW": (2_000, 1_000),
    },
}  # fmt: skip


@FLAVOURS
def test_slow_speed_parameter_is_reported(flavour: str) -> None:
    policy = case.policy()
    policy = replace(policy, vehicle=replace(policy.vehicle, speeds=SPEEDS))
    parameters = tuple((name, float(value)) for name, (value, _) in SLOW[flavour].items())
    found = examine(case.simulated(flavour, parameters=parameters), policy)
    for name, (_, better) in SLOW[flavour].items():
        finding = found[f"settings/{name.lower()}"]
        assert finding.verdict is MissionVerdict.WARN, name
        assert finding.needed.startswith("at most " if "ALT" in name else "at least "), name
        assert f"set `{name}` to {better:g}" in finding.advice, name


def test_return_speed_of_zero_is_compared_as_cruise_speed() -> None:
    """RTL_SPEED 0 is the speed of WPNAV_SPEED."""
    policy = case.policy()
    policy = replace(policy, vehicle=replace(policy.vehicle, speeds=SPEEDS))
    slow = examine(case.simulated("ardupilot", parameters=(("WPNAV_SPEED", 550.0),)), policy)["settings/rtl_speed"]
    assert (slow.verdict, slow.needed) == (MissionVerdict.WARN, "at least 6 m/s")
    assert "set `RTL_SPEED` to 600" in slow.advice
    own = (("WPNAV_SPEED", 550.0), ("RTL_SPEED", 600.0))
    found = examine(case.simulated("ardupilot", parameters=own), policy)
    assert {found[f"settings/{name}"].verdict for name in ("wpnav_speed", "rtl_speed")} == {MissionVerdict.OK}


@FLAVOURS
def test_unlimited_bounds_are_ok(flavour: str) -> None:
    found = examine(case.simulated(flavour))
    told = {slug: each.verdict for slug, each in found.items() if slug.startswith("settings/")}
    bounds = {
        "px4": {"settings/gf_max_hor_dist", "settings/gf_max_ver_dist", "settings/rtl_return_alt"},
        "ardupilot": {"settings/fence_radius", "settings/fence_alt_max", "settings/fence_type", "settings/rtl_alt"},
    }[flavour]
    assert {told[slug] for slug in bounds} == {MissionVerdict.OK}


def test_doctor_stops_for_other_than_multirotor() -> None:
    def winged(vehicle: VirtualVehicle) -> None:
        sender = Codec(1, 1)

        def hurt(datagram: bytes) -> list[bytes]:
            (frame,) = Codec(0, 0).parse(datagram)
            if frame.name != "HEARTBEAT":
                return [datagram]
            frame.message.type = mavlink.MAV_TYPE_FIXED_WING
            return [sender.pack(frame.message)]

        vehicle.hurt = hurt

    found = examine(case.simulated("ardupilot"), prepare=winged)
    assert found["autopilot/kind"].found == "the vehicle is not a multirotor (MAV_TYPE 1)"
    assert "autopilot/kind" in stops(found)


def test_slow_link_stops_a_mission_and_sparse_link_warns() -> None:
    def narrow(vehicle: VirtualVehicle) -> None:
        vehicle.driver.carried_by(960)

    finding = examine(case.simulated("px4"), prepare=narrow)["link/streams"]
    assert finding.verdict is MissionVerdict.STOP
    assert "carries 960 octets a second" in finding.found

    def sparse(vehicle: VirtualVehicle) -> None:
        every = itertools.count()
        vehicle.hurt = lambda datagram: [] if datagram[7] == 33 and next(every) % 4 else [datagram]

    finding = examine(case.simulated("px4"), prepare=sparse)["link/streams"]
    assert finding.verdict is MissionVerdict.WARN
    assert "GLOBAL_POSITION_INT every" in finding.found
    assert "MAV_n_RATE" in finding.advice
    finding = examine(case.simulated("px4"), seconds=4)["link/streams"]
    assert finding.verdict is MissionVerdict.UNKNOWN


@FLAVOURS
def test_missing_position_stops_a_mission(flavour: str) -> None:
    found = examine(case.simulated(flavour, faults=(GpsLoss(0),)))
    assert {"vehicle/ready", "sensor/gps", "signal/fix"} & stops(found) >= {"vehicle/ready", "sensor/gps"}
    assert found["sensor/gps"].needed == "a 3D fix"


def test_a_vehicle_far_from_the_home_of_the_policy() -> None:
    found = examine(case.simulated("px4", home=HomePosition(473_980_000, 85_500_000, 488_000)))
    assert stops(found) == {"mission/unready"}
    assert "m from the policy's home" in found["mission/unready"].found


def test_another_return_altitude_than_the_policy_says() -> None:
    policy = case.policy()
    policy = replace(policy, vehicle=replace(policy.vehicle, return_altitude=47_000))
    found = examine(case.simulated("px4"), policy)
    assert stops(found) == {"mission/unready"}
    assert "RTL_RETURN_ALT" in found["mission/unready"].found


@pytest.mark.slow
@rows(
    ("flavour", "parameter", "needed"),
    [
        ("px4", ("RTL_MIN_DIST", 20.0), "at most 10 m"),
        ("px4", ("NAV_MC_ALT_RAD", 3.0), "at most 2 m"),
        ("ardupilot", ("RTL_CONE_SLOPE", 1.0), "at least 3"),
        ("ardupilot", ("RTL_CLIMB_MIN", 500.0), "at most 0 m"),
        ("ardupilot", ("WPNAV_RADIUS", 300.0), "at most 2 m"),
        ("px4", ("RTL_TYPE", 1.0), "0, home, or a rally point that is nearer"),
        ("ardupilot", ("RTL_ALT_TYPE", 1.0), "0, home"),
        ("ardupilot", ("RALLY_TOTAL", 2.0), "0, none"),
    ],
)
def test_parameter_that_changes_way_home_stops_mission(flavour: str, parameter: tuple[str, float], needed: str) -> None:
    policy = case.policy()
    policy = replace(policy, vehicle=replace(policy.vehicle, return_altitude=16_000))
    found = examine(case.simulated(flavour, parameters=(parameter,)), policy)
    assert stops(found) == {"mission/unready"}
    assert f"(`{parameter[0]}` is {parameter[1]:g}" in found["mission/unready"].found
    finding = found[f"settings/{parameter[0].lower()}"]
    assert (finding.verdict, finding.needed) == (MissionVerdict.WARN, needed)
    well = examine(case.simulated(flavour), policy)
    assert (stops(well), well[f"settings/{parameter[0].lower()}"].verdict) == (set(), MissionVerdict.OK)


@rows(("flavour", "release", "says"), [
    ("px4", None, "PX4 1.16 accepts no key: use a wire"),
    ("px4", (1, 17), "`rtshcua keys link` makes a key"),
    ("ardupilot", None, "`rtshcua keys link` makes a key"),
])  # fmt: skip
def test_signing_key_is_advised_only_if_the_release_supports_it(
    flavour: str, release: tuple[int, int] | None, says: str
) -> None:
    assert says in examine(case.simulated(flavour, release=release))["link/signing"].advice


@FLAVOURS
def test_unnoticed_low_battery_stops_mission(flavour: str) -> None:
    """The autopilot does not react, and the policy only uses the charge."""
    name = "COM_LOW_BAT_ACT" if flavour == "px4" else "BATT_FS_LOW_ACT"
    config = case.simulated(flavour, parameters=((name, 0.0),))
    slug, by_charge = f"settings/{name.lower()}", case.policy()
    assert not any(each.dimension == "voltage" for each in by_charge.signals)
    assert examine(config, by_charge)[slug].verdict is MissionVerdict.STOP
    by_voltage = with_cells(by_charge, 4)
    assert examine(config, by_voltage)[slug].verdict is MissionVerdict.WARN
    set_up = case.simulated(flavour, parameters=((name, 2.0),))
    assert examine(set_up, by_charge)[slug].verdict is MissionVerdict.OK


def with_cells(policy: Policy, cells: int) -> Policy:
    source = SignalSource("SYS_STATUS", ("voltage_battery",), 1, cells, (0, 65_535))
    signal = Signal(CELL, policy.slots, NUMBER, "voltage", 5_000_000, (), (source,))
    return replace(policy, signals=(*policy.signals, signal), slots=policy.slots + 1)


@FLAVOURS
def test_wrong_number_of_cells_stops_mission(flavour: str) -> None:
    config = case.simulated(flavour)
    right = examine(config, with_cells(case.policy(), 4))["sensor/cells"]
    assert (right.verdict, right.found[:3]) == (MissionVerdict.OK, "4.2")
    for cells in (3, 6):
        assert examine(config, with_cells(case.policy(), cells))["sensor/cells"].verdict is MissionVerdict.STOP


def test_a_drain_is_not_missed_on_the_ground() -> None:
    plain = case.policy()
    source = SignalSource("BATTERY_STATUS", ("battery_remaining",), 100, 1, (-1,))
    signal = Signal(DRAIN, plain.slots, NUMBER, "ratio", 5_000_000, (), (source,))
    found = examine(case.simulated("px4"), replace(plain, signals=(*plain.signals, signal), slots=plain.slots + 1))
    assert found["signal/battery.drain"].verdict is MissionVerdict.UNKNOWN
    assert "measured in the air only" in found["signal/battery.drain"].found


def test_doctor_names_what_is_still_settling() -> None:
    seen: list[str | None] = []

    def watched(vehicle: VirtualVehicle) -> None:
        driver = vehicle.driver
        assert isinstance(driver, ExaminingDriver)
        plain = driver.tick

        def tick(now_us: int) -> Any:
            if driver.flavour is not None:
                seen.append(settling(driver))
            return plain(now_us)

        vehicle.driver.tick = tick  # type: ignore[method-assign]

    examine(case.simulated("ardupilot", boot=Boot.RECORDED), prepare=watched, seconds=60)
    assert any(each is not None and "fix" in each for each in seen)
    assert seen[-1] is None
    assert settled("a 3D fix", 12, None).found == "waited 12 s for a 3D fix"
    assert settled("a 3D fix", 60, "a 3D fix").verdict is MissionVerdict.WARN


@rows(("seconds", "needed"), [(60.0, "at least 1080 s"), (1_079.0, "at least 1080 s"), (1_080.0, ""), (0.0, "")])
def test_fast_simulated_battery_drain_of_px4_warns(seconds: float, needed: str) -> None:
    """With the default `SIM_BAT_DRAIN` of one minute, each simulated flight would soon return home."""
    (found,) = settings_told("px4", {"SIM_BAT_DRAIN": seconds}, case.policy(), FlightReach())
    assert (found.slug, found.needed) == ("settings/sim_bat_drain", needed)
    assert found.verdict is (MissionVerdict.WARN if needed else MissionVerdict.OK)
    if needed:
        assert found.advice == "set `SIM_BAT_DRAIN` to 1080"


def test_doctor_reports_the_battery_that_a_run_uses() -> None:
    others = (OtherBattery(Purpose.PAYLOAD, 500), OtherBattery(Purpose.PROPULSION, 6_000))
    found = examine(case.simulated("px4", other_batteries=others))["sensor/battery"]
    assert found.found == (
        "59 %: 0 with 99 %, 1 with 5 % (payload, which does not count), 2 with 59 %, and the one with the least charge "
        "counts"
    )


def test_a_limit_of_the_way_home_that_is_not_answered_is_unknown() -> None:
    def silent(vehicle: VirtualVehicle) -> None:
        vehicle.lose = lambda frame: b"RTL_TYPE" in frame

    policy = case.policy()
    policy = replace(policy, vehicle=replace(policy.vehicle, return_altitude=30_000))
    found = examine(case.simulated("px4"), policy, prepare=silent)
    finding = found["settings/unanswered"]
    assert (finding.verdict, finding.found.split(":")[0]) == (MissionVerdict.UNKNOWN, "`RTL_TYPE` was not answered")


def test_a_vehicle_that_answers_nothing() -> None:
    def deaf(vehicle: VirtualVehicle) -> None:
        vehicle.lose = lambda frame: True

    found = examine(case.simulated("px4"), prepare=deaf)
    assert "link/answers" in stops(found)
    assert "--signing-key" in found["link/answers"].advice
    assert found["autopilot/version"].verdict is found["settings/unread"].verdict is MissionVerdict.UNKNOWN


@FLAVOURS
def test_a_vehicle_whose_clock_is_not_known(flavour: str) -> None:
    codec = Codec(0, 0)

    def without_time(vehicle: VirtualVehicle) -> None:
        vehicle.lose = lambda frame: any(each.name == "TIMESYNC" for each in codec.parse(frame))

    found = examine(case.simulated(flavour), prepare=without_time)
    assert "link/round-trip" in stops(found)
    assert found["link/round-trip"].found == "TIMESYNC is not answered, so the age of the reports is not known"
    assert found["link/answers"].verdict is MissionVerdict.OK
    assert any(slug.startswith("signal/") for slug in stops(found)), "no signal is known"


def test_a_signal_that_nobody_sends() -> None:
    found = examine(case.simulated("px4", extras=EQUIPPED - {Equipment.RANGE}))
    (obstacle,) = [each for slug, each in found.items() if slug.startswith("signal/obstacle")]
    assert obstacle.verdict in (MissionVerdict.STOP, MissionVerdict.WARN)
    assert obstacle.found.endswith("no DISTANCE_SENSOR arrives")


@FLAVOURS
def test_vehicle_time_counts_without_synchronised_clock(flavour: str) -> None:
    told = examine(case.simulated(flavour, utc_us=case.flat.ISSUED), utc_error_us=None)["mission/clock"]
    assert told.verdict is MissionVerdict.OK
    silent = case.simulated(flavour, faults=(MessageSilence(0, "SYSTEM_TIME"),))
    assert "mission/clock" in stops(examine(silent, utc_error_us=None))
    assert "mission/clock" not in stops(examine(silent))
    assert "mission/clock" not in stops(examine(silent, utc_error_us=None, stated_us=500_000))


@FLAVOURS
def test_vehicle_time_is_unused_where_boundary_refuses_it(flavour: str) -> None:
    config = case.simulated(flavour, utc_us=case.flat.ISSUED)
    stop = examine(config, utc_error_us=None, vehicle_counts=False)["mission/clock"]
    assert stop.verdict is MissionVerdict.STOP
    assert "only over a link with a key" in stop.found
    assert "`--signing-key`" in stop.advice
    assert "`--utc-error 500ms`" in stop.advice
    stated = examine(config, utc_error_us=None, vehicle_counts=False, stated_us=500_000)["mission/clock"]
    assert (stated.verdict, "500 ms" in stated.found) == (MissionVerdict.OK, True)


@FLAVOURS
def test_the_wind_is_not_asked_for_on_the_ground(flavour: str) -> None:
    wind = examine(case.simulated(flavour))["signal/wind.speed"]
    assert wind.verdict is MissionVerdict.UNKNOWN
    assert wind.found == "`wind.speed` is known in the air only, so it is unknown now"


def test_a_lossy_link() -> None:
    found = examine(case.simulated("px4", faults=(LinkLoss(0, 4_000),)), seconds=20)
    assert "link/loss" in stops(found)


def test_second_mediator_and_ground_station_are_reported() -> None:
    twin, station = Codec(1, 191), Codec(255, 190)

    def crowded(vehicle: VirtualVehicle) -> None:
        beat = mavlink.MAVLink_heartbeat_message
        vehicle.hurt = lambda frame: [
            frame, twin.pack(beat(18, 8, 0, 0, 4, 3)), station.pack(beat(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        ]  # fmt: skip

    found = examine(case.simulated("px4"), prepare=crowded, seconds=6)
    assert "link/component" in stops(found)
    assert found["link/ground-station"].found == "1 ground station(s) heard"


def signs(flavour: str, utc_us: int) -> SimulationConfig:
    """A vehicle with the key; an ArduCopter acts on a low battery."""
    acts = (("BATT_FS_LOW_ACT", 2.0),) if flavour == "ardupilot" else ()
    return case.simulated(flavour, signing_key=KEY, utc_us=utc_us, parameters=acts)


def signed(flavour: str, seconds: int = 14, **words: Any) -> dict[str, VehicleFinding]:
    """The same on a link with a key."""
    now = VirtualClock().now()
    link = SignedLink(KEY, SigningState(0, {}), now.utc_us, now.monotonic_us)
    frames = FrameSession()
    frames.sign_with(link)
    policy, clock = case.policy(), VirtualClock()
    vehicle = VirtualVehicle(policy, signs(flavour, now.utc_us), clock, frames)
    vehicle.driver = ExaminingDriver(policy, clock, frames, link)
    while clock.elapsed_us < seconds * SECOND:
        vehicle.poll(clock.now().monotonic_us, SECOND)
    findings = diagnose(vehicle.driver, policy, MISSION, keyed=True, time=TimeSources(1_000), **words)
    return {each.slug: each for each in findings}


def test_unsigned_needed_signal_stops_mission() -> None:
    policy = case.policy()
    found = signed("ardupilot", unheard=unheard(policy, {"RADIO_STATUS"}))
    assert stops(found) == {"signal/link.quality"}
    assert "--unsigned-radio" in found["signal/link.quality"].advice


@FLAVOURS
def test_signing_vehicle_without_key_is_the_only_stop(flavour: str) -> None:
    utc_us = VirtualClock().now().utc_us
    found = examine(case.simulated(flavour, signing_key=KEY, utc_us=utc_us))
    assert stops(found) == {"link/signing"}
    assert "--signing-key" in found["link/signing"].advice
    assert found["link/answers"].verdict is MissionVerdict.UNKNOWN
    assert "no key was given" in found["link/round-trip"].found
    signals = {slug: each for slug, each in found.items() if slug.startswith("signal/")}
    assert {each.verdict for each in signals.values()} <= {MissionVerdict.OK, MissionVerdict.UNKNOWN}, signals


def test_ignored_radio_frames_give_no_link_quality() -> None:
    found = signed("ardupilot")
    assert found["signal/link.quality"].verdict is MissionVerdict.STOP, "the radio's frames are heard, and not taken in"


@pytest.mark.parametrize(("return_mm", "said"), [(case.LOW, "home and return altitude are"), (0, "no `return at`")])
def test_doctor_names_only_compared_values(return_mm: int, said: str) -> None:
    policy = case.policy()
    policy = replace(policy, vehicle=replace(policy.vehicle, return_altitude=return_mm))
    found = examine(case.simulated("px4", return_mm=case.LOW), policy)["mission/place"]
    assert found.verdict is MissionVerdict.OK
    assert said in found.found
    assert ("return altitude are" in found.found) == bool(return_mm)


def test_unreported_facts_are_not_ok() -> None:
    policy = case.policy()
    policy = replace(policy, vehicle=replace(policy.vehicle, return_altitude=47_000))
    codec = Codec(0, 0)
    mute = {"EXTENDED_SYS_STATE", "GLOBAL_POSITION_INT", "PARAM_VALUE"}

    def silent(vehicle: VirtualVehicle) -> None:
        vehicle.hurt = lambda frame: [] if any(each.name in mute for each in codec.parse(frame)) else [frame]

    found = examine(case.simulated("ardupilot"), policy, prepare=silent)
    assert found["vehicle/down"].verdict is MissionVerdict.UNKNOWN
    assert found["mission/place"].verdict is MissionVerdict.UNKNOWN
    mute.remove("GLOBAL_POSITION_INT")
    found = examine(case.simulated("ardupilot"), policy, prepare=silent)
    assert found["mission/place"].verdict is MissionVerdict.UNKNOWN
    assert "RTL_ALT" in found["mission/place"].found


BEAT = mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 3, 3)


@pytest.mark.parametrize("elsewhere", [False, True], ids=["same sender", "another sender"])
def test_another_vehicle_at_the_port(elsewhere: bool) -> None:
    other = Codec(2, 1)

    def crowded(vehicle: VirtualVehicle) -> None:
        def also(frame: bytes) -> list[bytes]:
            if elsewhere and vehicle.driver.flavour is not None:
                vehicle.driver.overhear(other.pack(BEAT), vehicle.clock.now().monotonic_us)
            return [frame] if elsewhere else [frame, other.pack(BEAT)]

        vehicle.hurt = also

    found = examine(case.simulated("px4"), prepare=crowded, seconds=6)
    assert found["link/other-vehicle"].verdict is MissionVerdict.STOP
    assert "system 2" in found["link/other-vehicle"].found


def test_two_vehicles_of_one_id() -> None:
    twin = Codec(1, 1)

    def crowded(vehicle: VirtualVehicle) -> None:
        def also(frame: bytes) -> list[bytes]:
            if vehicle.driver.flavour is not None:
                vehicle.driver.overhear(twin.pack(BEAT), vehicle.clock.now().monotonic_us)
            return [frame]

        vehicle.hurt = also

    found = examine(case.simulated("px4"), prepare=crowded, seconds=6)
    assert "its own id" in found["link/other-vehicle"].found
    assert found["link/loss"].verdict is MissionVerdict.OK, "the other one's frames are not counted as this one's"


@pytest.mark.parametrize(("user", "own", "apart"), [(1001, 1000, True), (1000, 1000, False), (0, 1000, False)])
def test_an_agent_that_runs_as_the_operator_is_not_told_apart(user: int, own: int, apart: bool) -> None:
    found = told_apart("openclaw", user, own)
    assert found.verdict is (MissionVerdict.OK if apart else MissionVerdict.WARN)
    assert "`openclaw`" in found.found
    assert bool(found.advice) != apart


@pytest.mark.parametrize(("flavour", "name", "has", "meant"), [
    ("ardupilot", "FENCE_RADIUS", 30.0, 300.0), ("px4", "GF_MAX_HOR_DIST", 2.0, 300.0),
])  # fmt: skip
def test_values_of_set_option_are_reported_and_judged(flavour: str, name: str, has: float, meant: float) -> None:
    config = case.simulated(flavour, parameters=((name, has),))
    slug, sent = f"settings/{name.lower()}", [0]

    def watch(vehicle: VirtualVehicle) -> None:
        def count(frame: bytes) -> bool:
            sent[0] += sum(each.name == "PARAM_SET" for each in Codec(0, 0).parse(frame))
            return False

        vehicle.lose = count

    plain = examine(config, prepare=watch)
    assert plain[slug].verdict is MissionVerdict.WARN
    assert "mission/unready" in stops(plain)
    bits = bits_of(meant)
    assert bits is not None
    found = examine(config, prepare=watch, meant={name: bits})
    assert found[slug].verdict is MissionVerdict.OK
    assert f"`--set` makes it {meant:g} m ({meant:g}), and {has:g} again after it" in found[slug].found
    assert stops(found) == set()
    other = "GF_ACTION" if flavour == "ardupilot" else "FENCE_TYPE"
    assert f"settings/{other.lower()}" in stops(examine(config, meant={name: bits, other: bits}))
    assert sent == [0], "nothing is set"


def test_zero_with_a_meaning_is_shown_as_its_meaning() -> None:
    fence = next(each for each in SETTINGS["px4"] if each.parameter == "GF_MAX_HOR_DIST")
    found = {value: _setting(fence, value, None, None, None).found for value in (0.0, 300.0)}
    assert found[0.0] == "radius of its own fence around home: no limit (GF_MAX_HOR_DIST = 0)"
    assert found[300.0] == "radius of its own fence around home: 300 m (GF_MAX_HOR_DIST = 300)"
