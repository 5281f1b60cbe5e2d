"""The message rates that a program needs so that its steps can be decided in time.

The compiler and the adapters share these figures. The compiler proves with them that the values a step waits for
can arrive before its deadline; the adapters request the rates from the vehicle. Each message is requested several
times within the stale time of its signals and within the shortest deadline of a step that waits for one of them.
The rate is no higher than any autopilot can report, and high enough for the effects that the adapters observe. All
times in us.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Final, NamedTuple

from rtshcua.decision.tree import slots_read, where
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Contract, TimingClass
from rtshcua.model.flat.policy import Policy, RuleKind
from rtshcua.model.flat.signal import Signal

#: Limits of the requested interval between two reports: links and autopilots support no shorter one, and a longer
#: one is never requested.
MOST_OFTEN: Final = 50_000
LEAST_OFTEN: Final = 1_000_000
#: The number of reports requested within a stale time, and within a deadline.
WITHIN_STALE: Final = 4
WITHIN_DEADLINE: Final = 2

#: The adapters observe effects, takeovers and readiness in these messages, so they are requested at least this
#: often.
AT_LEAST: Final[Mapping[str, int]] = {
    "HEARTBEAT": 100_000,
    "GLOBAL_POSITION_INT": 100_000,
    "EXTENDED_SYS_STATE": 100_000,
    "ATTITUDE": 100_000,
    "GPS_RAW_INT": 500_000,
    "SYS_STATUS": 500_000,
}
#: On a slow link they may be as rare as this, because mode and landed state are requested separately.
SUFFICES: Final[Mapping[str, int]] = {
    "HEARTBEAT": 1_000_000,
    "GLOBAL_POSITION_INT": 250_000,
    "EXTENDED_SYS_STATE": 250_000,
    "ATTITUDE": 250_000,
    "GPS_RAW_INT": 1_000_000,
    "SYS_STATUS": 1_000_000,
}
#: These messages cannot be requested more often: PX4's HEARTBEAT is constant and its CURRENT_MODE came 1.8 times a
#: second (docs/flying/link.md has the recordings); a radio reports once a second and accepts no requests.
AT_BEST: Final[Mapping[str, int]] = {"HEARTBEAT": 1_000_000, "CURRENT_MODE": 560_000, "RADIO_STATUS": 1_000_000}
#: How much older than its report a value may be. A receiver measures five times a second by default, and a value
#: without a time stamp counts as measured at the last position before it.
FIX: Final = 200_000
UNSTAMPED: Final = 100_000


class Rate(NamedTuple):
    """The interval between two reports of a message: the requested one, and the longest that is sufficient."""

    asked: int
    suffices: int


def rates(policy: Policy, contracts: Iterable[Contract] = ()) -> dict[str, Rate]:
    """The rate of each message that the policy's signals are read from. `contracts` are those of a mission's steps,
    because their own blocks may shorten the deadlines of the policy's skills.
    """
    waits = _waits(policy, contracts)
    asked: dict[str, int] = {}
    suffices: dict[str, int] = {}
    for signal in policy.signals:
        wait = min((waits[slot] for slot in signal.slots if slot in waits), default=LEAST_OFTEN * WITHIN_DEADLINE)
        often = min(signal.stale_us // WITHIN_STALE, wait // WITHIN_DEADLINE)
        seldom = min(signal.stale_us // 2, wait)
        for source in signal.sources:
            asked[source.message] = min(often, asked.get(source.message, LEAST_OFTEN))
            suffices[source.message] = min(seldom, suffices.get(source.message, LEAST_OFTEN))
    found: dict[str, Rate] = {}
    for name in asked:
        often = min(max(asked[name], MOST_OFTEN), AT_LEAST.get(name, LEAST_OFTEN))
        seldom = min(suffices[name], SUFFICES.get(name, LEAST_OFTEN))
        found[name] = Rate(often, max(often, seldom))
    return found


def delivered(asked: Mapping[str, Rate], message: str, every_us: int | None = None) -> int:
    """The interval between two reports of a message, on a link with enough capacity, from any autopilot; `every_us`:
    how often its sender reports it, where that is known.
    """
    return max(asked[message].asked, AT_BEST.get(message, 0) if every_us is None else every_us)


def awaited(policy: Policy, skill: int, contract: Contract) -> Iterator[Clause]:
    """The clauses that a decision on a contract may wait for: its own, and those of the `forbid` and `degrade` rules
    that may match.
    """
    yield from (*contract.require, *contract.assume, *contract.maintain)
    for rule in policy.rules:
        if rule.when is None or skill not in (rule.skills or (skill,)):
            continue
        # a rule that degrades to the same skill does not apply to it
        if rule.kind == RuleKind.FORBID or (rule.target is not None and rule.target.skill != skill):
            yield rule.when


def signal_of(policy: Policy, slot: int) -> Signal:
    """The signal that owns a slot."""
    return next(signal for signal in policy.signals if slot in signal.slots)


def _waits(policy: Policy, contracts: Iterable[Contract]) -> dict[int, int]:
    """The shortest deadline of a step that may wait for a slot. A reflex does not wait."""
    numbers = {contract.name: number for number, contract in enumerate(policy.contracts)}
    waits: dict[int, int] = {}
    for contract in (*policy.contracts, *contracts):
        if contract.timing_class == TimingClass.REFLEX:
            continue
        clauses = awaited(policy, numbers[contract.name], contract)
        vehicle = policy.vehicle  # every step reads position and charge
        for slot in (*slots_read(clauses, vehicle, policy.monitors), *where(vehicle), vehicle.battery):
            waits[slot] = min(contract.deadline_us, waits.get(slot, contract.deadline_us))
    return waits
