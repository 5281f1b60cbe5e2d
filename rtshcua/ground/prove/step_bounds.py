"""E0804, E0814, E0815: each step, and each link of its chains, is done in the time that its skill allows; each step,
and each return of its chains, with the charge.

Durations are those of `decision.flying`: the speeds that the vehicle declares, against the most wind that it is flown
in, and no more than what the step assumes of the wind. Of a return, the speed of the slowest step before it counts too,
for an autopilot may go on with a speed that it was told (PX4). Charge is that of the time in the air.
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
from rtshcua.model.quantity import Dimension, display

SECOND_US: Final = 1_000_000
_MILLISECOND: Final = 1_000
_METRE: Final = 1_000  # mm
#: where to write what, and what that is
_Fix = tuple[Span, str, str]
#: where autopilots report the wind
_WIND_MESSAGES: Final = ("WIND_COV", "WIND")


class StepBound(NamedTuple):
    """What a step is proved to take at most: us from its dispatch to its end, and 1/10000 of a full charge."""

    skill: str
    time_us: int
    energy: int


def prove_step_bounds(
    proof: ProofContext, step: MissionStep, starts: Sequence[StartPlace], slowest: int
) -> StepBound | None:
    """What a step takes at most that may begin at `starts`; None after a finding. `slowest` is the slowest speed that
    it and those before it ask for, mm/s, 0 if none does.
    """
    before = len(proof.report.found)
    speeds, contract = proof.speeds, step.contract
    wind = _wind(proof, step.prepared)

    def takes(height: int) -> int:
        """What it takes if it leads to a height."""
        return max(_step_us(proof, step.prepared, start, height, slowest, wind) for start in starts)

    time_us, fits = takes(step.flat.plan.altitude), contract.energy * speeds.flight_us // FULL
    if 0 < contract.duration_us < time_us:
        skill = proof.skills[contract.name]
        limit = (step.overrides and step.overrides.duration) or skill.duration
        assert limit is not None
        nearer = _nearer(proof, step, starts[0].height, takes, min(fits, contract.duration_us))
        _too_long(proof, step, "the step", contract, time_us, contract.duration_us, limit.span, nearer, slowest)
    energy = charge(speeds, time_us)
    # a return is never refused for want of charge, and the mission's bound counts the way home, if that is more
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
        if not _is_told(proof, link):
            _too_much(proof, step, "the return, a link of this step's chains,", link, needed, code=codes.RETURN_ENERGY)
    if home and energy > contract.energy:
        _too_much(proof, step, "the return", contract, energy, code=codes.RETURN_ENERGY)
    return StepBound(contract.name, time_us, energy)


def _nearer(proof: ProofContext, step: MissionStep, here: int, takes: Callable[[int], int], fits: int) -> _Fix | None:
    """The height nearest to what the step asks for, towards where it begins, to which it takes no longer than `fits`;
    None where its height is no argument, or none does.
    """
    contract, asked = step.contract, step.flat.plan.altitude
    cell = contract.motion.altitude
    parameter = next((each for each in contract.parameters if 0 <= each.cell == cell), None)
    span = None if parameter is None else argument_span(proof.context, step.declared, parameter.name)
    if parameter is None or span is None or span == step.span or not parameter.low <= here <= parameter.high:
        return None
    sign = 1 if here > asked else -1
    least, most = 0, abs(here - asked) // _METRE
    if takes(asked + sign * most * _METRE) > fits:
        return None
    while least < most:  # the fewest metres nearer that are enough
        middle = (least + most) // 2
        least, most = (least, middle) if takes(asked + sign * middle * _METRE) <= fits else (middle + 1, most)
    height = display(asked + sign * least * _METRE, Dimension.ALTITUDE)
    return span, height, f"write `{height}`"


def _wind(proof: ProofContext, invocation: PreparedInvocation) -> int:
    """The most wind in which a step goes on: what the vehicle is flown in, and what `assume` and `degrade` leave."""
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
        while low < high:  # the least wind from which on it never goes on
            middle = (low + high) // 2
            low, high = (middle + 1, high) if goes_on(slot, middle) else (low, middle)
        most = min(most, low)
    return most


def _step_us(
    proof: ProofContext, invocation: PreparedInvocation, start: StartPlace, altitude: int, slowest: int, wind: int
) -> int:
    """How long a step takes at most from where it begins to where it is done, which is at a height."""
    flat, vehicle, speeds = invocation.invocation, proof.policy.vehicle, proof.speeds
    plan = flat.plan
    height = sinking_us(speeds, start.height - altitude) + rising_us(speeds, altitude - start.height)
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
    return BEGINS + sum(leg_us(speeds, length(a, b) + 1, speed) for a, b in pairwise(points)) + height + SETTLES


def _is_told(proof: ProofContext, contract: Contract) -> bool:
    """Whether it was said already of another step that this return may take more than its skill says."""
    written = f"`{contract.name}` takes at most"
    return any(each.code is codes.RETURN_ENERGY and written in each.message for each in proof.report.found)


def _prove_links(
    proof: ProofContext, step: MissionStep, starts: Sequence[StartPlace], slowest: int
) -> list[tuple[Contract, int]]:
    """Report the first link that may take longer than it may, wherever in the step it begins. Given are the returns
    that may take more charge than their skill says, and how much; none is refused for that.
    """
    returns: list[tuple[Contract, int]] = []
    if step.flat.plan.kind in (MotionKind.HOME, MotionKind.LAND):
        return returns  # what follows it lands
    volumes = [planned(proof, step.prepared, start)[1] for start in starts]
    distance = max(volume.farthest[1] for volume in volumes)
    low = min(volume.height[0] for volume in volumes)
    high = max(volume.height[1] for volume in volumes)
    degrades = [rule.target for rule in step.prepared.candidates.degrades]
    for chain in (degrades, step.prepared.chain, proof.prepared.contingency):
        reach, so_far = (distance, low, high), slowest
        for link in chain:
            reach, time_us = _link_us(proof, link, *reach, so_far)
            contract = proof.policy.contracts[link.link.skill]
            asks = contract.motion.speed >= 0 and contract.motion.kind == MotionKind.FLY
            so_far = slower(so_far, link.link.arguments[contract.motion.speed] if asks else 0)
            allowed = link.link.limit_us or contract.duration_us
            name = f"`{contract.name}`, a link of this step's chains,"
            if link is not chain[-1] and 0 < allowed < time_us:
                declared = proof.skills[contract.name].duration
                limit = proof.span(link.link) if link.link.limit_us or declared is None else declared.span
                _too_long(proof, step, name, contract, time_us, allowed, limit, slowest=slowest)
                return []
            needed = charge(proof.speeds, time_us)
            if link.motion == MotionKind.HOME and needed > contract.energy:
                returns.append((contract, needed))
    return returns


def _link_us(
    proof: ProofContext, link: PreparedLink, distance: int, low: int, high: int, slowest: int
) -> tuple[tuple[int, int, int], int]:
    """From how far and between which heights later links begin, and how long a link takes at most; 0: it is cut."""
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
    asked = arguments[cell] if cell >= 0 else cruise
    way = leg_us(speeds, distance + away, over_ground(speeds, asked))
    return (max(distance, away), *there[1:]), BEGINS + way + height + SETTLES


def _too_long(
    proof: ProofContext,
    step: MissionStep,
    what: str,
    contract: Contract,
    time_us: int,
    allowed: int,
    limit: Span,
    nearer: _Fix | None = None,
    slowest: int = 0,
) -> None:
    speeds = proof.speeds
    goes_on = ""
    if contract.motion.kind == MotionKind.HOME and 0 < slowest < speeds.homeward:
        goes_on = f", at {display(slowest, Dimension.SPEED)}, the slowest that a step asks for"
    size = named_at(proof.report, proof.skills[contract.name], limit)
    enough = display(-(-time_us // SECOND_US) * SECOND_US, Dimension.DURATION)
    longer = "let it last longer" if size is None else f"write `sizes {contract.name}({size} = {enough})`"
    lasts = f"`{contract.name}` lasts at most {display(allowed, Dimension.DURATION)}"
    over = time_us - allowed
    proof.report.add(
        codes.PLAN_TOO_LONG,
        step.span if nearer is None else nearer[0],
        f"{what} takes up to {enough}, and {lasts}"
        if over >= SECOND_US
        else f"{lasts}, and {what} takes up to "
        f"{display(-(-over // _MILLISECOND) * _MILLISECOND, Dimension.DURATION)} longer",
        help=f"fly a shorter path, or faster, or {longer}; {_counted_with(proof)}{goes_on}",
        labels=[(limit, "declared here"), *_speeds_span(proof)],
        fix=nearer,
        amount=time_us,
    )


def _too_much(
    proof: ProofContext,
    step: MissionStep,
    what: str,
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
        f"{what} takes up to {enough} of a full charge, and `{contract.name}` takes at most "
        f"{display(contract.energy, Dimension.RATIO)}",
        help=f"write {more}, or fly a shorter path, or faster; {_counted_with(proof)}",
        labels=[(declared.span, "declared here"), *_speeds_span(proof)],
        fix=nearer,
        amount=energy,
    )


def _speeds_span(proof: ProofContext) -> Iterator[tuple[Span, str]]:
    """Where the vehicle says how fast it is."""
    speeds = proof.lowered.vehicle.speeds
    if speeds:
        first, last = speeds[0].span, speeds[-1].span
        yield Span(first.file, first.start, last.end), "the speeds that are counted with"


def _counted_with(proof: ProofContext) -> str:
    """By which speeds it was counted, in words."""
    speeds, vehicle = proof.speeds, proof.policy.vehicle
    names = {"cruise": speeds.cruise, "climb": speeds.climb, "descent": speeds.descent, "landing": speeds.landing}
    told = ", ".join(f"{name} {display(value, Dimension.SPEED)}" for name, value in names.items())
    against = f"against {display(speeds.wind, Dimension.SPEED)} of wind" if speeds.wind else "without wind"
    if proof.lowered.vehicle.speeds:
        return f"counted with the speeds of `{vehicle.name}`, {against}"
    return f"`{vehicle.name}` declares no `speeds`: counted with {told}, {against}"
