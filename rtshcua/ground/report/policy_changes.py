"""The changes between two policies in words, and the zones, skills, signals and rules that a page marks.

The comparison uses the signed forms, because the source of an earlier policy may no longer exist.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import isqrt
from typing import Final

from rtshcua.decision.outline import rings
from rtshcua.ground.report.prose.mission_steps import describe_cells
from rtshcua.ground.report.prose.phrases import degrees, listed, name, named, time_of_day, time_of_week
from rtshcua.ground.report.prose.rules_and_skills import describe_evidence, describe_limits, describe_silence
from rtshcua.ground.report.prose.zones_and_vehicle import describe_fitted, utc
from rtshcua.ground.report.report_model import ChangeView
from rtshcua.ground.versions.differences import Difference, Fields, PolicyMeaning, compared
from rtshcua.ground.versions.direction import direction
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import CHOICE, QUANTITY, Contract, Link, MotionKind, Parameter, TimingClass
from rtshcua.model.flat.policy import AfterSilence, Policy, RuleKind, Speeds, WithoutEvidence
from rtshcua.model.flat.signal import ENUMERATION, Signal
from rtshcua.model.flat.zone import CIRCLE, HIGHEST, LOWEST, Zone, unproject
from rtshcua.model.quantity import Dimension, display

#: added if the words before and after are the same
ELSE: Final = "the same text, but it refers to something else"
_DIMENSIONS: Final = {dimension.value: dimension for dimension in Dimension}


def describe_difference(one: Difference, old: Policy, new: Policy) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the lines of the old and the new state; empty if there is none."""
    if one.kind == "rule":
        before, after = (
            tuple(name(" ".join(each.split())) for each in (text,) if each) for text in (one.before, one.after)
        )
    else:
        before, after = _described(one, old), _described(one, new)
    return before, (*after, ELSE) if before == after else after


def _described(one: Difference, policy: Policy) -> tuple[str, ...]:
    match one.kind:
        case "airspace":
            return (_airspace(policy),)
        case "contingency":
            return (_chain(policy.contingency, policy),)
        case "evidence":
            return (describe_evidence(WithoutEvidence(policy.without_evidence).name.lower()),)
        case "silence":
            return (describe_silence(policy.silence_us, AfterSilence(policy.after_silence).name.lower()),)
        case "sensor":
            return (describe_fitted(one.name, one.name not in policy.vehicle.without),)
        case "order":
            kind = RuleKind[one.name.upper()]
            return tuple(name(rule.text) for rule in policy.rules if rule.kind == kind)
    figures = _figures(one, policy)
    return () if figures is None else tuple(f"{field}: {figures[field]() or 'nothing'}" for field in one.fields)


def _figures(one: Difference, policy: Policy) -> Mapping[str, Callable[[], str]] | None:
    """The fields of the vehicle, or of a zone, skill or signal, as functions that describe them; None if there is none
    of this name.
    """
    match one.kind:
        case "vehicle":
            return _vehicle(policy)
        case "zone":
            zones = policy.zones[: policy.declared]
            return next((_zone(zone, policy) for zone in zones if zone.name == one.name), None)
        case "skill":
            return next((_skill(each, policy) for each in policy.contracts if each.name == one.name), None)
        case _:
            return next((_signal(signal) for signal in policy.signals if signal.name == one.name), None)


def _airspace(policy: Policy) -> str:
    if policy.airspace is None:
        return describe_limits((), ())
    inside, outside = (
        [policy.zones[number].name for number in side] for side in (policy.airspace.inside, policy.airspace.outside)
    )
    return describe_limits(inside, outside)


def _chain(links: Iterable[Link], policy: Policy) -> str:
    return ", then ".join(_link(each, policy) for each in links)


def _link(link: Link, policy: Policy) -> str:
    contract = policy.contracts[link.skill]
    arguments = [f"{name(each.name)} {describe_cells(each, link.arguments, policy)}" for each in contract.parameters]
    limit = f" for at most {_time(link.limit_us)}" if link.limit_us else ""
    return name(contract.name) + (f" with {listed(arguments)}" if arguments else "") + limit


def _vehicle(policy: Policy) -> Mapping[str, Callable[[], str]]:
    vehicle, home = policy.vehicle, policy.projection
    offset = vehicle.utc_offset_us
    return {
        "name": lambda: name(vehicle.name),
        "identity": lambda: vehicle.identity,
        "home": lambda: f"{_place(home.latitude, home.longitude)}, within {_length(vehicle.home_within)}",
        "speed": lambda: f"at most {display(vehicle.speed, Dimension.SPEED)}",
        "climb": lambda: f"at most {display(vehicle.climb, Dimension.SPEED)}",
        "position error": lambda: f"at most {_length(vehicle.position_error)}",
        "energy": lambda: f"{_time(vehicle.endurance_us)} of hovering",
        "reserve": lambda: display(vehicle.reserve, Dimension.RATIO),
        "local time": lambda: vehicle.time_zone or f"UTC {'-' if offset < 0 else '+'}{time_of_day(abs(offset))}",
        "brakes": lambda: (
            f"{display(vehicle.braking, Dimension.SPEED)} less in each second, after a delay of "
            f"{_time(vehicle.reaction_us)}"
            if vehicle.braking
            else ""
        ),
        "return": lambda: f"at {_length(vehicle.return_altitude)} above home" if vehicle.return_altitude else "",
        "speeds": lambda: _speeds(vehicle.speeds),
    }


def _speeds(speeds: Speeds | None) -> str:
    if speeds is None:
        return ""
    names = {
        "cruise": speeds.cruise,
        "climb": speeds.climb,
        "descent": speeds.descent,
        "landing": speeds.landing,
        "return": speeds.homeward,
        "air": speeds.air,
        "wind at most": speeds.wind,
        "gained in a second": speeds.acceleration,
    }
    listing = ", ".join(f"{label} {display(value, Dimension.SPEED)}" for label, value in names.items())
    return f"{listing}, slow below {_length(speeds.landing_below)}, {_time(speeds.flight_us)} of flight"


def _zone(zone: Zone, policy: Policy) -> Mapping[str, Callable[[], str]]:
    return {
        "shape": lambda: _shape(zone, policy),
        "floor": lambda: "" if zone.floor == LOWEST else f"{_length(zone.floor)} above home",
        "ceiling": lambda: "" if zone.ceiling == HIGHEST else f"{_length(zone.ceiling)} above home",
        "active": lambda: _active(zone),
    }


def _shape(zone: Zone, policy: Policy) -> str:
    def place(x: int, y: int) -> str:
        return _place(*unproject(policy.projection, x, y))

    if zone.shape == CIRCLE:
        x, y, squared = zone.data
        return f"a circle of {_length(isqrt(squared))} around {place(x, y)}"
    return "; ".join(f"an outline through {' - '.join(place(x, y) for x, y in ring)}" for ring in rings(zone))


def _active(zone: Zone) -> str:
    daily = f"every day from {' to '.join(map(time_of_day, zone.daily))} local time" if zone.daily else ""
    weekly = zip(map(time_of_week, zone.weekly[::2]), (time_of_week(end - 1) for end in zone.weekly[1::2]), strict=True)
    hours = (
        f"every week from {listed([f'{start} to {end}' for start, end in weekly])} local time" if zone.weekly else ""
    )
    dates = f"from {' to '.join(map(utc, zone.dates))}" if zone.dates else ""
    return listed([each for each in (daily, hours, dates) if each]) or "at all times"


def _skill(contract: Contract, policy: Policy) -> Mapping[str, Callable[[], str]]:
    phases = f", only in the phase {named(contract.phases, 'or')}" if contract.phases else ""
    motion = contract.motion
    cells = {each.cell: name(each.name) for each in contract.parameters}
    given = [cells[cell] for cell in (motion.lowest, motion.altitude, motion.speed, motion.time) if cell in cells]
    motion_given = (f" with {listed(given)}" if given else "") + (" facing inward" if motion.facing else "")
    return {
        "parameters": lambda: "; ".join(map(_parameter, contract.parameters)),
        "motion": lambda: name(MotionKind(motion.kind).name.lower()) + motion_given,
        "class": lambda: name(TimingClass(contract.timing_class).name.lower()),
        "deadline": lambda: _time(contract.deadline_us),
        "valid": lambda: f"for {_time(contract.validity_us)}{phases}",
        "lasts": lambda: f"at most {_time(contract.duration_us)}",
        "grace": lambda: _time(contract.grace_us),
        "require": lambda: _clauses(contract.require),
        "assume": lambda: _clauses(contract.assume),
        "maintain": lambda: _clauses(contract.maintain),
        "fallback": lambda: _chain(contract.fallback, policy),
        "energy": lambda: f"at most {display(contract.energy, Dimension.RATIO)} of a full charge",
        "record": lambda: named(sorted(contract.record)),
        "emits": lambda: listed([name(each.text) for each in contract.emits]) or "nothing",
    }


def _parameter(parameter: Parameter) -> str:
    words = name(parameter.name)
    if parameter.kind == CHOICE:
        return f"{words} one of {named(parameter.labels, 'or')}"
    dimension = _DIMENSIONS.get(parameter.dimension)
    if parameter.kind != QUANTITY or dimension is None:
        return words
    return f"{words} between {display(parameter.low, dimension)} and {display(parameter.high, dimension)}"


def _clauses(clauses: Iterable[Clause]) -> str:
    return " and ".join(name(clause.text) for clause in clauses)


def _signal(signal: Signal) -> Mapping[str, Callable[[], str]]:
    states = [f"{name(label)} ({number})" for number, label in sorted(signal.labels)]
    return {
        "type": lambda: name(signal.dimension) + (f" {', '.join(states)}" if signal.kind == ENUMERATION else ""),
        "stale": lambda: f"after {_time(signal.stale_us)}",
        "source": lambda: listed(
            [
                f"{name(each.message)} field {named(each.fields)}"
                + (f" (unknown at {', '.join(map(str, each.unknown))})" if each.unknown else "")
                for each in signal.sources
            ],
            "or",
        ),
    }


def _place(latitude: int, longitude: int) -> str:
    return f"{degrees(latitude, 'N', 'S')}, {degrees(longitude, 'E', 'W')}"


def _length(mm: int) -> str:
    return display(mm, Dimension.LENGTH)


def _time(us: int) -> str:
    return display(us, Dimension.DURATION)


@dataclass(frozen=True, slots=True)
class PolicyChanges:
    """The changes in words, and the new or changed zones, skills, signals and rules (by number)."""

    told: tuple[ChangeView, ...] = ()
    zones: frozenset[str] = frozenset()
    skills: frozenset[str] = frozenset()
    signals: frozenset[str] = frozenset()
    rules: frozenset[int] = frozenset()


def describe_changes(old: Policy, new: Policy) -> tuple[ChangeView, ...]:
    """Describe the differences with their directions."""
    return tuple(
        ChangeView(each.text.removeprefix("looser: "), *describe_difference(each, old, new), direction(each, old, new))
        for each in compared(old, new)
    )


def changes(old: Policy, new: Policy) -> PolicyChanges:
    """Return the changes of meaning, which are the same as those of `check --since`."""
    common = frozenset(zone.name for zone in old.zones[: old.declared])
    common &= {zone.name for zone in new.zones[: new.declared]}
    moved = old.projection != new.projection
    before, after = PolicyMeaning(old, common, moved=moved), PolicyMeaning(new, common, moved=moved)
    known = {rule.meaning for rule in before.rules()}
    return PolicyChanges(
        describe_changes(old, new),
        _changed(before.zones(), after.zones()),
        _changed(before.skills(), after.skills()),
        _changed(before.signals(), after.signals()),
        frozenset(number for number, rule in enumerate(after.rules()) if rule.meaning not in known),
    )


def _changed(old: Mapping[str, Fields], new: Mapping[str, Fields]) -> frozenset[str]:
    return frozenset(name for name, fields in new.items() if old.get(name) != fields)
