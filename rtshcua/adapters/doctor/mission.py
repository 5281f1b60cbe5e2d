"""What the doctor finds about a bundle's needs: each signal by its stream, the return altitude, home, and the clock."""

from collections.abc import Iterator, Sequence
from typing import Final

from rtshcua.adapters.doctor.examination import Examination
from rtshcua.adapters.doctor.finding import Finding, Verdict
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import Signal
from rtshcua.onboard.rehearsal import needed

#: a message should come this often within the time to stale of what it carries
_TIMES: Final = 2
_CLOCK_US: Final = 1_000_000


def signals(
    vehicle: Examination, policy: Policy, mission: Mission | None, unheard: frozenset[int]
) -> Iterator[Finding]:
    """Whether each signal of the policy is known, and comes often enough to stay so."""
    wanted = _needed(policy, mission)
    for signal in policy.signals:
        slots = signal.slots
        is_needed = not wanted.isdisjoint(slots)
        if unheard.isdisjoint(slots):
            yield _signal(vehicle, signal, is_needed=is_needed, slots=slots)
        else:
            names = " or ".join(source.message for source in signal.sources)
            found = f"`{signal.name}` stays unknown: nobody signs {names}, and nothing unsigned is believed here"
            bad = Verdict.STOP if is_needed else Verdict.WARN
            yield Finding(f"signal/{signal.name}", bad, found, names, "`--unsigned-radio`, here and for `run`")


def bound(vehicle: Examination, policy: Policy, utc_error_us: int) -> Iterator[Finding]:
    """What stands between this vehicle and a bundle that was made for it."""
    preflight = vehicle.settled
    astray = None if preflight is None else preflight.astray
    unknown = None if preflight is None else preflight.unplaced or preflight.unread
    if astray is not None:
        yield Finding("mission/unready", Verdict.STOP, astray, "as the policy has it")
    elif unknown is not None or preflight is None:
        yield Finding("mission/place", Verdict.UNKNOWN, unknown or "nothing was heard", "as the policy has it")
    else:
        yield Finding("mission/place", Verdict.OK, "home and return altitude are those of the policy")
    ahead_us = vehicle.facts.ahead_us
    if ahead_us is None:
        yield Finding("mission/clock", Verdict.UNKNOWN, "the vehicle does not tell the time (SYSTEM_TIME)")
    elif abs(ahead_us) > _CLOCK_US + utc_error_us:
        found = f"the vehicle's clock and this machine's are {abs(ahead_us) // 1_000_000} s apart"
        advice = "one of them is wrong; validity and times of day are judged by this machine's"
        yield Finding("mission/clock", Verdict.WARN, found, "the same time", advice)
    else:
        yield Finding("mission/clock", Verdict.OK, "the vehicle's clock agrees with this machine's")


def _needed(policy: Policy, mission: Mission | None) -> set[int]:
    """The state slots without which a step is not admitted, as far as its contract says."""
    well_known = policy.vehicle.position, policy.vehicle.position + 1, policy.vehicle.height, policy.vehicle.battery
    slots = {slot for slot in well_known if slot >= 0}
    for invocation in () if mission is None else mission.invocations:
        slots.update(needed(policy, invocation))
    return slots


def _signal(vehicle: Examination, signal: Signal, *, is_needed: bool, slots: Sequence[int]) -> Finding:
    slug = f"signal/{signal.name}"
    facts = vehicle.facts
    heard = [source.message for source in signal.sources if source.message in facts.streams]
    bad = Verdict.STOP if is_needed else Verdict.WARN
    if not heard:
        names = " or ".join(source.message for source in signal.sources)
        return Finding(slug, bad, f"`{signal.name}` stays unknown: no {names}", names, _ADVICE)
    stream = facts.streams[heard[0]]
    if any(facts.values.get(slot) is None for slot in slots):
        found = f"`{signal.name}` is unknown now: {heard[0]} comes, and says so or is not vouched for"
        return Finding(slug, bad, found, "a value")
    interval_us = stream.interval_us
    every = "came once" if interval_us is None else f"every {interval_us // 1_000} ms"
    found = f"`{signal.name}`: {heard[0]} {every}, stale after {signal.stale_us // 1_000} ms"
    if interval_us is not None and interval_us * _TIMES <= signal.stale_us:
        return Finding(slug, Verdict.OK, found)
    return Finding(slug, Verdict.WARN, found, f"twice within {signal.stale_us // 1_000} ms", _ADVICE)


_ADVICE: Final = "a higher stream rate, or another source for the signal in the policy"
