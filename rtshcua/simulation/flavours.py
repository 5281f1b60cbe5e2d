"""The two flavours, each put together from its own files."""

from collections.abc import Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.simulation.activity import Event
from rtshcua.simulation.ardupilot import arming as ardupilot_arming
from rtshcua.simulation.ardupilot import boot as ardupilot_boot
from rtshcua.simulation.ardupilot import commands as ardupilot_commands
from rtshcua.simulation.ardupilot import failsafe as ardupilot_failsafe
from rtshcua.simulation.ardupilot import fence as ardupilot_fence
from rtshcua.simulation.ardupilot import modes as ardupilot_modes
from rtshcua.simulation.ardupilot import parameters as ardupilot_parameters
from rtshcua.simulation.ardupilot import plans as ardupilot_plans
from rtshcua.simulation.ardupilot import signing as ardupilot_signing
from rtshcua.simulation.ardupilot import streams as ardupilot_streams
from rtshcua.simulation.autopilot import Flavour
from rtshcua.simulation.config import Kind
from rtshcua.simulation.pilot import copter_sticks, px4_sticks
from rtshcua.simulation.px4 import arming as px4_arming
from rtshcua.simulation.px4 import boot as px4_boot
from rtshcua.simulation.px4 import commands as px4_commands
from rtshcua.simulation.px4 import failsafe as px4_failsafe
from rtshcua.simulation.px4 import fence as px4_fence
from rtshcua.simulation.px4 import modes as px4_modes
from rtshcua.simulation.px4 import parameters as px4_parameters
from rtshcua.simulation.px4 import plans as px4_plans
from rtshcua.simulation.px4 import signing as px4_signing
from rtshcua.simulation.px4 import streams as px4_streams

FLAVOURS: Mapping[Kind, Flavour] = {
    Kind.PX4: Flavour(
        autopilot=mavlink.MAV_AUTOPILOT_PX4,
        modes=px4_modes.MODES,
        handling=px4_parameters.handling,
        commands=px4_commands.COMMANDS,
        on_set_mode=px4_commands.on_set_mode,
        on_position_target=px4_commands.on_position_target,
        on_data_stream=px4_commands.on_data_stream,
        streams=px4_streams.DEFAULT,
        builders=px4_streams.BUILDERS,
        constant=px4_streams.CONSTANT,
        only_streamed=px4_streams.ONLY_STREAMED,
        least_us=px4_streams.LEAST_US,
        parameters=px4_parameters.PARAMETERS,
        transfer=px4_plans.TRANSFER,
        missions=px4_plans.MISSIONS,
        home_item=None,
        on_setup_signing=px4_signing.on_setup_signing,
        insists=px4_signing.insists,
        on_plan=px4_plans.on_plan,
        fence=px4_fence.RULES,
        on_breach=px4_fence.on_breach,
        on_mode_in_breach=px4_fence.on_mode_in_breach,
        on_breach_cleared=px4_fence.on_breach_cleared,
        bytewise=True,
        texts={
            Event.ARMED: "Armed by external command\t",
            Event.DISARMED: "Disarmed by external command\t",
            Event.TAKEOFF: "Takeoff detected\t",
            Event.RETURN: "Returning to launch\t",
            Event.RETURN_CLIMB: "RTL: start return at {amsl} m ({up} m above destination)\t",
            Event.HOME: "RTL: land at destination\t",
            Event.LANDED: "Landing detected\t",
            Event.TIPPED: "Attitude failure detected\t",
            Event.AUTO_DISARMED: "Disarmed by landing\t",
        },
        boot=px4_boot.BOOT,
        failsafes=px4_failsafe.RULES,
        arming=px4_arming.reasons,
        fix=mavlink.GPS_FIX_TYPE_3D_FIX,
        coast_s=5.0,
        texts_need_ground_station=True,
        check_text="Preflight Fail",
        beats_on_mode=False,
        reminds=False,
        on_sticks=px4_sticks,
        target_timeout_us=1_000_000,
        tells_fence=False,
    ),
    Kind.ARDUPILOT: Flavour(
        autopilot=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
        modes=ardupilot_modes.MODES,
        handling=ardupilot_parameters.handling,
        commands=ardupilot_commands.COMMANDS,
        on_set_mode=ardupilot_commands.on_set_mode,
        on_position_target=ardupilot_commands.on_position_target,
        on_data_stream=ardupilot_commands.on_data_stream,
        streams=ardupilot_streams.DEFAULT,
        builders=ardupilot_streams.BUILDERS,
        constant=frozenset(),
        only_streamed=frozenset(),
        least_us={},
        parameters=ardupilot_parameters.PARAMETERS,
        transfer=ardupilot_plans.TRANSFER,
        missions=ardupilot_plans.MISSIONS,
        home_item=ardupilot_plans.home_item,
        on_setup_signing=ardupilot_signing.on_setup_signing,
        insists=ardupilot_signing.insists,
        on_plan=ardupilot_plans.on_plan,
        fence=ardupilot_fence.RULES,
        on_breach=ardupilot_fence.on_breach,
        on_mode_in_breach=ardupilot_fence.on_mode_in_breach,
        on_breach_cleared=ardupilot_fence.on_breach_cleared,
        bytewise=False,
        texts={
            Event.ARMED: "Arming motors",
            Event.DISARMED: "Disarming motors",
            Event.TOUCHED: "SIM Hit ground at {speed:f} m/s",
            Event.CRASHED: "Crash: Disarming: AngErr=80>30, Accel=1.0<3.0",
            Event.AUTO_DISARMED: "Disarming motors",
        },
        boot=ardupilot_boot.BOOT,
        failsafes=ardupilot_failsafe.RULES,
        arming=ardupilot_arming.reasons,
        fix=mavlink.GPS_FIX_TYPE_RTK_FIXED,
        coast_s=7.0,
        texts_need_ground_station=False,
        check_text="PreArm",
        beats_on_mode=True,
        reminds=True,
        on_sticks=copter_sticks,
        target_timeout_us=None,
        tells_fence=True,
    ),
}
