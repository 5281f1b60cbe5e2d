"""How often reports of a signal come, for the proofs that something comes of them in time.

The figures are those that the adapters ask by: `decision.rates`.
"""

from collections.abc import Mapping, Sequence

from rtshcua.decision import rates
from rtshcua.mavlink.dialect import Dialect
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import Signal, SignalSource

#: messages that a vehicle is sent and never sends itself as telemetry
COMMANDS = frozenset({
    "COMMAND_INT", "COMMAND_LONG", "FILE_TRANSFER_PROTOCOL", "GPS_INJECT_DATA", "GPS_RTCM_DATA",
    "LOG_ERASE", "LOG_REQUEST_DATA", "LOG_REQUEST_END", "LOG_REQUEST_LIST", "MANUAL_CONTROL", "MANUAL_SETPOINT",
    "MISSION_CLEAR_ALL", "MISSION_REQUEST_LIST", "MISSION_SET_CURRENT", "PARAM_REQUEST_LIST", "PARAM_REQUEST_READ",
    "PARAM_SET", "RC_CHANNELS_OVERRIDE", "REQUEST_DATA_STREAM", "SET_ACTUATOR_CONTROL_TARGET", "SET_ATTITUDE_TARGET",
    "SET_GPS_GLOBAL_ORIGIN", "SET_HOME_POSITION", "SET_MODE", "SET_POSITION_TARGET_GLOBAL_INT",
    "SET_POSITION_TARGET_LOCAL_NED", "SETUP_SIGNING",
})  # fmt: skip


#: what tells when the vehicle measured, among a message's fields
STAMPS = frozenset({"time_boot_ms", "time_usec"})


def report_intervals(policy: Policy, contracts: Sequence[Contract] = ()) -> dict[str, int]:
    """How long it is between two reports of each message that a policy's signals are read from, in us: as asked for,
    where any autopilot reports so often.
    """
    return rates.delivered(rates.rates(policy, contracts))


def older_by(message: str, dialect: Dialect) -> int:
    """How much older than its report what a message carries may be, in us, on a link without delay."""
    if message == "GPS_RAW_INT":
        return rates.FIX
    known = dialect.messages.get(message)
    return rates.UNSTAMPED if known is None or STAMPS.isdisjoint(known.fields) else 0


def arrives(signal: Signal) -> bool:
    """Whether a vehicle ever reports a signal."""
    return any(source.message not in COMMANDS for source in signal.sources)


def best(signal: Signal, intervals: Mapping[str, int]) -> SignalSource:
    """The source of a signal that reports most often."""
    return min(signal.sources, key=lambda source: intervals[source.message])


def interval(signal: Signal, intervals: Mapping[str, int]) -> int:
    """How long it is at most between two reports of a signal, from the most frequent of its messages."""
    return intervals[best(signal, intervals).message]
