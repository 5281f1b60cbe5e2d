"""How often the vehicle is asked to report what a signal is read from.

The adapters ask for each message several times within the time after which its signals are stale; some they ask for at
a fixed rate, because effects are seen by them. These are their figures (a test compares them): the ground does not
import what flies.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import POSITION, Signal

#: messages that a vehicle is sent and never sends itself as telemetry
COMMANDS = frozenset({
    "COMMAND_INT", "COMMAND_LONG", "FILE_TRANSFER_PROTOCOL", "GPS_INJECT_DATA", "GPS_RTCM_DATA",
    "LOG_ERASE", "LOG_REQUEST_DATA", "LOG_REQUEST_END", "LOG_REQUEST_LIST", "MANUAL_CONTROL", "MANUAL_SETPOINT",
    "MISSION_CLEAR_ALL", "MISSION_REQUEST_LIST", "MISSION_SET_CURRENT", "PARAM_REQUEST_LIST", "PARAM_REQUEST_READ",
    "PARAM_SET", "RC_CHANNELS_OVERRIDE", "REQUEST_DATA_STREAM", "SET_ACTUATOR_CONTROL_TARGET", "SET_ATTITUDE_TARGET",
    "SET_GPS_GLOBAL_ORIGIN", "SET_HOME_POSITION", "SET_MODE", "SET_POSITION_TARGET_GLOBAL_INT",
    "SET_POSITION_TARGET_LOCAL_NED", "SETUP_SIGNING",
})  # fmt: skip


@dataclass(frozen=True, slots=True)
class Rates:
    """Times in us. A message is asked for `within_stale` times within the shortest time to stale of what it carries,
    between `most_often` and `least_often`; those of `fixed` at that interval whatever they carry.
    """

    most_often: int = 100_000
    least_often: int = 1_000_000
    within_stale: int = 4
    fixed: Mapping[str, int] = field(
        default_factory=lambda: {
            "HEARTBEAT": 100_000,
            "GLOBAL_POSITION_INT": 100_000,
            "EXTENDED_SYS_STATE": 100_000,
            "ATTITUDE": 100_000,
            "GPS_RAW_INT": 500_000,
            "SYS_STATUS": 500_000,
        }
    )

    def intervals(self, policy: Policy) -> dict[str, int]:
        """How long it is between two reports of each message that a policy's signals are read from."""
        stale: dict[str, int] = {}
        for signal in policy.signals:
            for source in signal.sources:
                stale[source.message] = min(signal.stale_us, stale.get(source.message, signal.stale_us))
        asked = {
            name: min(max(least // self.within_stale, self.most_often), self.least_often)
            for name, least in stale.items()
        }
        return {name: self.fixed.get(name, interval) for name, interval in asked.items()}


RATES = Rates()


def signal_of(policy: Policy, slot: int) -> Signal:
    """The signal that owns a slot."""
    return next(
        signal
        for signal in policy.signals
        if slot == signal.slot or (signal.kind == POSITION and slot == signal.slot + 1)
    )


def arrives(signal: Signal) -> bool:
    """Whether a vehicle ever reports a signal."""
    return any(source.message not in COMMANDS for source in signal.sources)


def interval(signal: Signal, intervals: Mapping[str, int]) -> int:
    """How long it is at most between two reports of a signal, from the most frequent of its messages."""
    return min(intervals[source.message] for source in signal.sources)
