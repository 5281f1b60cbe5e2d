"""Prove that each step and each link finishes within the duration of its skill (E0804), and each step and each return
within its energy (E0814, E0815).

Durations follow `decision.flying`: the declared speeds of the vehicle, against the strongest wind in which it is flown
or, if that is less, the strongest wind that the step assumes. A return may also fly at the speed of the slowest step
before it, because an autopilot may keep a speed that was set (PX4). The charge follows from the time in the air.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from math import isqrt
from typing import Final, NamedTuple

from rtshcua.decision.contracts import first_cell
from rtshcua.decision.flying import (
    BEGINS,
    LIFTS,
    SETTLES,
    charge,
    home_us,
    landing_us,
    leg_us,
    over_ground,
    rising_us,
    sinking_us,
    slower,
)
from rtshcua.decision.prepare import PreparedInvocation, PreparedLink
from rtshcua.decision.values import TRUE, interval
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.codes import Code
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.substitution import named_at
from rtshcua.ground.geometry.polygons import Point, length
from rtshcua.ground.lower.mission import argument_span
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.step_starts import StartPlace, planned
from rtshcua.ground.prove.step_times import MissionStep
from rtshcua.model.flat.contract import PLACE, Contract, MotionKind
from rtshcua.model.flat.limits import FULL, MAX_SPEED
from rtshcua.model.flat.mission import ALONG, TURN
from rtshcua.model.flat.policy import Speeds
from rtshcua.model.quantity import Dimension, display

SECOND_US: Final = 1_000_000
_MILLISECOND: Final = 1_000
_METRE: Final = 1_000  # mm
#: the least rate at which a nose turns, 1/100 degree a second; the defaults of PX4 and ArduCopter are faster
_TURN_RATE: Final = 4_500
#: a fix: the span to replace, the new text, and its title
_Fix = tuple[Span, str, str]
#: the messages in which autopilots report the wind
_WIND_MESSAGES: Final = ("WIND_COV", "WIND")


class StepBound(NamedTuple):
    """The proved bounds of a step: us from its dispatch to its end, and energy in 1/10000 of a full charge."""

    skill: str
    time_us: int
    energy: int


def prove_step_bounds(
    proof: ProofContext, step: MissionStep, starts: Sequence[StartPlace], slowest: int
) -> StepBound | None:
    """Return the bounds of a step that may begin at `starts`, or None after a finding.

    `slowest` is the lowest speed that this step and the steps before it set, in mm/s, or 0 if none sets a speed.
    """
    before = len(proof.report.found)
    speeds, contract = proof.speeds, step.contract
    wind = _wind(proof, step.prepared)

    def takes(height: int) -> int:
        """The longest time of the step in us if it flies to a height."""
        return max(_step_us(proof, step.prepared, start, height, slowest, wind) for start in starts)

    time_us, fits = takes(step.flat.plan.altitude), contract.energy * speeds.flight_us // FULL
    if 0 < contract.duration_us < time_us:
        skill = proof.skills[contract.name]
        limit = (step.overrides and step.overrides.duration) or skill.duration
        assert limit is not None
        nearer = _nearer(proof, step, starts[0].height, takes, min(fits, contract.duration_us))
        _too_long(proof, step, "the step", contract, time_us, contract.duration_us, limit.span, nearer, slowest)
    energy = charge(speeds, time_us)
    # a return is never refused for lack of charge, and the mission's bound includes the way home
    home = step.flat.plan.kind == MotionKind.HOME
    if len(proof.report.found) == before and energy > contract.energy and not home:
        fits = min(fits, contract.duration_us or fits)
        nearer = _nearer(proof, step, starts[0].height, takes, fits)
        _too_much(proof, step, "the step", contract, energy, nearer)
    returns: list[tuple[Contract, int]] = []
    if len(proof.report.found) == before:
        returns = _prove_links(proof, step, starts, slowest)
    if len(proof.report.found) > before:
        return None
    for link, needed in returns:
        if not _is_reported(proof, link):
            _too_much(proof, step, "the return, a link of this step's chains,", link, needed, code=codes.RETURN_ENERGY)
    if home and energy > contract.energy:
        _too_much(proof, step, "the return", contract, energy, code=codes.RETURN_ENERGY)
    return StepBound(contract.name, time_us, energy)


def _nearer(proof: ProofContext, step: MissionStep, here: int, takes: Callable[[int], int], fits: int) -> _Fix | None:
    """Return a fix with the height nearest to the planned one, towards the start, that the step reaches in `fits` us.

    Returns None if the height is not an argument of the step, or if there is no such height.
    """
    contract, planned_height = step.contract, step.flat.plan.altitude
    cell = contract.motion.altitude
    parameter = next((each for each in contract.parameters if 0 <= each.cell == cell), None)
    span = None if parameter is None else argument_span(proof.context, step.declared, parameter.name)
    if parameter is None or span is None or span == step.span or not parameter.low <= here <= parameter.high:
        return None
    if step.flat.plan.heights:
        return None  # the highest height does not alone determine the time
    sign = 1 if here > planned_height else -1
    least, most = 0, abs(here - planned_height) // _METRE
    if takes(planned_height + sign * most * _METRE) > fits:
        return None
    while least < most:  # find the smallest sufficient change, in metres
        middle = (least + most) // 2
        least, most = (least, middle) if takes(planned_height + sign * middle * _METRE) <= fits else (middle + 1, most)
    height = display(planned_height + sign * least * _METRE, Dimension.ALTITUDE)
    return span, height, f"write `{height}`"


def _wind(proof: ProofContext, invocation: PreparedInvocation) -> int:
    """Return the strongest wind in mm/s in which a step continues, by the vehicle, its `assume` and `degrade` rules."""
    policy, most = proof.policy, proof.speeds.wind
    slots = [
        signal.slot
        for signal in policy.signals
        if signal.dimension == Dimension.SPEED.value and all(each.message in _WIND_MESSAGES for each in signal.sources)
    ]
    at = proof.around(invocation)

    def goes_on(slot: int, wind: int) -> bool:
        values = list(at.slots)
        values[slot] = interval(wind, MAX_SPEED)
        there = at.over(values, None, 0)
        return all(condition(there) & TRUE for _, condition in invocation.assume) and not any(
            rule.condition(there) == TRUE for rule in invocation.candidates.degrades
        )

    for slot in slots:
        low, high = 0, most + 1
        while low < high:  # find the least wind from which on the step never continues
            middle = (low + high) // 2
            low, high = (middle + 1, high) if goes_on(slot, middle) else (low, middle)
        most = min(most, low)
    return most


def _step_us(
    proof: ProofContext, invocation: PreparedInvocation, start: StartPlace, altitude: int, slowest: int, wind: int
) -> int:
    """Return the longest time of a step in us from its start to its end at an altitude."""
    flat, vehicle, speeds = invocation.invocation, proof.policy.vehicle, proof.speeds
    plan = flat.plan
    height = _between_us(speeds, start.height, altitude)
    match plan.kind:
        case MotionKind.HOLD:
            cell = flat.contract.motion.time
            return BEGINS + SETTLES + flat.arguments[cell] if cell >= 0 else flat.contract.duration_us
        case MotionKind.CLIMB:
            return BEGINS + (SETTLES if start.aloft else LIFTS) + height
        case MotionKind.HOME:
            distance = isqrt(start.x * start.x + start.y * start.y) + 1
            return home_us(vehicle, speeds, distance, (start.height, start.height), slowest)
        case MotionKind.LAND:
            return BEGINS + SETTLES + landing_us(speeds, start.height)
    points: list[Point] = [(start.x, start.y), *zip(plan.path[::2], plan.path[1::2], strict=True)]
    speed = over_ground(speeds, plan.speed or min(speeds.cruise, slowest or speeds.cruise), wind)
    legs = [leg_us(speeds, length(a, b) + 1, speed) for a, b in pairwise(points)]
    if plan.headings:
        legs = list(map(max, legs, _turns_us(plan.headings)))
    if plan.heights:
        height = sum(_between_us(speeds, a, b) for a, b in pairwise((start.height, *plan.heights)))
    return BEGINS + sum(legs) + height + SETTLES


def _turns_us(headings: Sequence[int]) -> list[int]:
    """Return the duration of the turn of the nose to each heading, to the first from any other. It turns while it flies
    a leg, so a leg takes longer only if its turn does.
    """
    turns = (
        TURN // 2 if ALONG in pair else abs((pair[1] - pair[0] + TURN // 2) % TURN - TURN // 2)
        for pair in pairwise((ALONG, *headings))
    )
    return [BEGINS + -(-turn * SECOND_US // _TURN_RATE) for turn in turns]


def _between_us(speeds: Speeds, here: int, there: int) -> int:
    """Return the duration of a climb or a descent."""
    return rising_us(speeds, there - here) + sinking_us(speeds, here - there)


def _is_reported(proof: ProofContext, contract: Contract) -> bool:
    """Whether the energy of this return is already reported for another step."""
    written = f"`{contract.name}` may use at most"
    return any(each.code is codes.RETURN_ENERGY and written in each.message for each in proof.report.found)


def _prove_links(
    proof: ProofContext, step: MissionStep, starts: Sequence[StartPlace], slowest: int
) -> list[tuple[Contract, int]]:
    """Report the first link that may exceed its duration, wherever in the step it begins.

    Returns the returns that may exceed the energy of their skill, with the charge that they need.
    """
    returns: list[tuple[Contract, int]] = []
    for link, last, time_us in _link_times(proof, step, starts, slowest):
        contract = proof.policy.contracts[link.link.skill]
        allowed = link.link.limit_us or contract.duration_us
        if not last and 0 < allowed < time_us:
            name = f"`{contract.name}`, a link of this step's chains,"
            declared = proof.skills[contract.name].duration
            limit = proof.span(link.link) if link.link.limit_us or declared is None else declared.span
            _too_long(proof, step, name, contract, time_us, allowed, limit, slowest=slowest)
            return []
        needed = charge(proof.speeds, time_us)
        if link.motion == MotionKind.HOME and needed > contract.energy:
            returns.append((contract, needed))
    return returns


def _link_times(
    proof: ProofContext, step: MissionStep, starts: Sequence[StartPlace], slowest: int
) -> Iterator[tuple[PreparedLink, bool, int]]:
    """Yield each link of a step's chains, with whether it is the last one, and its longest time in us."""
    if step.flat.plan.kind in (MotionKind.HOME, MotionKind.LAND):
        return  # the links after it only land
    volumes = [planned(proof, step.prepared, start)[1] for start in starts]
    distance = max(volume.farthest[1] for volume in volumes)
    lows, highs = zip(*(volume.height[:2] for volume in volumes), strict=True)
    degrades = [rule.target for rule in step.prepared.candidates.degrades]
    for chain in (degrades, step.prepared.chain, proof.prepared.contingency):
        reach, so_far = (distance, min(lows), max(highs)), slowest
        for link in chain:
            reach, time_us = _link_us(proof, link, *reach, so_far)
            yield link, link is chain[-1], time_us
            motion = proof.policy.contracts[link.link.skill].motion
            if motion.speed >= 0 and motion.kind == MotionKind.FLY:
                so_far = slower(so_far, link.link.arguments[motion.speed])


def _link_us(
    proof: ProofContext, link: PreparedLink, distance: int, low: int, high: int, slowest: int
) -> tuple[tuple[int, int, int], int]:
    """Return the reach at which later links begin (distance, low, high), and the longest time of a link in us.

    The time is 0 for a hold, which ends at its limit.
    """
    vehicle, speeds = proof.policy.vehicle, proof.speeds
    contract, arguments = proof.policy.contracts[link.link.skill], link.link.arguments
    reach = (distance, low, high)
    match link.motion:
        case MotionKind.HOME:
            return reach, home_us(vehicle, speeds, distance, (low, high), slowest)
        case MotionKind.LAND:
            return reach, BEGINS + SETTLES + landing_us(speeds, high)
        case MotionKind.HOLD:
            return reach, 0
    altitude = arguments[contract.motion.altitude]
    height = rising_us(speeds, altitude - low) + sinking_us(speeds, high - altitude)
    there = (distance, min(low, altitude), max(high, altitude))
    if link.motion == MotionKind.CLIMB:
        return there, BEGINS + SETTLES + height
    place = first_cell(contract, PLACE)
    x, y = arguments[place : place + 2]
    away = isqrt(x * x + y * y) + 1
    cell, cruise = contract.motion.speed, min(speeds.cruise, slowest or speeds.cruise)
    speed = arguments[cell] if cell >= 0 else cruise
    way = leg_us(speeds, distance + away, over_ground(speeds, speed))
    return (max(distance, away), *there[1:]), BEGINS + way + height + SETTLES


def _too_long(
    proof: ProofContext,
    step: MissionStep,
    subject: str,
    contract: Contract,
    time_us: int,
    allowed: int,
    limit: Span,
    nearer: _Fix | None = None,
    slowest: int = 0,
) -> None:
    speeds = proof.speeds
    kept_speed = ""
    if contract.motion.kind == MotionKind.HOME and 0 < slowest < speeds.homeward:
        kept_speed = f", at {display(slowest, Dimension.SPEED)}, the lowest speed that a step sets"
    size = named_at(proof.report, proof.skills[contract.name], limit)
    enough = display(-(-time_us // SECOND_US) * SECOND_US, Dimension.DURATION)
    longer = "raise `lasts at most`" if size is None else f"write `sizes {contract.name}({size} = {enough})`"
    lasts = f"`{contract.name}` lasts at most {display(allowed, Dimension.DURATION)}"
    over = time_us - allowed
    proof.report.add(
        codes.PLAN_TOO_LONG,
        step.span if nearer is None else nearer[0],
        f"{subject} takes up to {enough}, but {lasts}"
        if over >= SECOND_US
        else f"{lasts}, but {subject} takes up to "
        f"{display(-(-over // _MILLISECOND) * _MILLISECOND, Dimension.DURATION)} longer",
        help=f"fly a shorter path, fly faster, or {longer}; {_counted_with(proof)}{kept_speed}",
        labels=[(limit, "declared here"), *_speeds_span(proof)],
        fix=nearer,
        amount=time_us,
    )


def _too_much(
    proof: ProofContext,
    step: MissionStep,
    subject: str,
    contract: Contract,
    energy: int,
    nearer: _Fix | None = None,
    code: Code = codes.STEP_ENERGY,
) -> None:
    skill = proof.skills[contract.name]
    own = None if step.overrides is None or contract.name != step.declared.skill.text else step.overrides.energy
    declared = own or skill.energy
    assert declared is not None
    needed = -(-energy // 10) * 10  # to a tenth of a percent
    size = None if own is not None else named_at(proof.report, skill, declared.span)
    enough = display(needed, Dimension.RATIO)
    more = f"`energy at most {enough}`" if size is None else f"`sizes {contract.name}({size} = {enough})`"
    proof.report.add(
        code,
        step.span if nearer is None else nearer[0],
        f"{subject} needs up to {enough} of a full charge, but `{contract.name}` may use at most "
        f"{display(contract.energy, Dimension.RATIO)}",
        help=f"write {more}, fly a shorter path, or fly faster; {_counted_with(proof)}",
        labels=[(declared.span, "declared here"), *_speeds_span(proof)],
        fix=nearer,
        amount=energy,
    )


def _speeds_span(proof: ProofContext) -> Iterator[tuple[Span, str]]:
    """Yield a label for the declared speeds of the vehicle."""
    speeds = proof.lowered.vehicle.speeds
    if speeds:
        first, last = speeds[0].span, speeds[-1].span
        yield Span(first.file, first.start, last.end), "the speeds of the estimate"


def _counted_with(proof: ProofContext) -> str:
    """Describe the speeds with which durations are estimated."""
    speeds, vehicle = proof.speeds, proof.policy.vehicle
    names = {"cruise": speeds.cruise, "climb": speeds.climb, "descent": speeds.descent, "landing": speeds.landing}
    defaults = ", ".join(f"{name} {display(value, Dimension.SPEED)}" for name, value in names.items())
    against = f"against {display(speeds.wind, Dimension.SPEED)} of wind" if speeds.wind else "without wind"
    if proof.lowered.vehicle.speeds:
        return f"the estimate uses the speeds of `{vehicle.name}`, {against}"
    return f"`{vehicle.name}` declares no `speeds`: the estimate uses {defaults}, {against}"
