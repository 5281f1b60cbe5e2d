"""The two flavours, each put together from its own files."""

from collections.abc import Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.simulation.ardupilot import commands as ardupilot_commands
from rtshcua.simulation.ardupilot import modes as ardupilot_modes
from rtshcua.simulation.ardupilot import parameters as ardupilot_parameters
from rtshcua.simulation.ardupilot import streams as ardupilot_streams
from rtshcua.simulation.autopilot import Flavour
from rtshcua.simulation.config import Kind
from rtshcua.simulation.px4 import commands as px4_commands
from rtshcua.simulation.px4 import modes as px4_modes
from rtshcua.simulation.px4 import parameters as px4_parameters
from rtshcua.simulation.px4 import streams as px4_streams
from rtshcua.simulation.vehicle import Event

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
        parameters=px4_parameters.PARAMETERS,
        bytewise=True,
        texts={
            Event.ARMED: "Armed by external command\t",
            Event.DISARMED: "Disarmed by external command\t",
            Event.TAKEOFF: "Takeoff detected\t",
            Event.RETURN: "Returning to launch\t",
            Event.LANDED: "Landing detected\t",
            Event.AUTO_DISARMED: "Disarmed by landing\t",
        },
        gps_failsafe="Failsafe: no global position, landing blindly\t",
        battery_failsafe="Emergency battery level, landing immediately\t",
        coast_s=5.0,
        texts_need_ground_station=True,
        target_timeout_us=1_000_000,
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
        parameters=ardupilot_parameters.PARAMETERS,
        bytewise=False,
        texts={
            Event.ARMED: "Arming motors",
            Event.DISARMED: "Disarming motors",
            Event.LANDED: "SIM Hit ground",
            Event.AUTO_DISARMED: "Disarming motors",
        },
        gps_failsafe="EKF Failsafe: changed to LAND Mode",
        battery_failsafe="Battery Failsafe",
        coast_s=7.0,
        texts_need_ground_station=False,
        target_timeout_us=None,
    ),
}
