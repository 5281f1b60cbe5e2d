"""Write a scenario as source text."""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

from rtshcua.model.faults import KINDS, Fault, FaultField, parameters
from rtshcua.model.quantity import Dimension, display
from rtshcua.model.scenario import AfterStep, AtTime, OnCondition, Scenario, Start, When

_NAMES = {kind: name.replace("-", "_") for name, kind in KINDS.items()}


def scenario_text(scenario: Scenario, mission: str, imported: str, comment: str = "") -> str:
    """Return a source file with this scenario; `imported` is the file of the mission, `comment` a leading comment."""
    lines = [f"// {line}".rstrip() for line in comment.splitlines()]
    lines += [f'import "{imported}"', "", f'scenario "{scenario.name}" {{', f"  flies  {mission}"]
    lines.append(f"  aboard {', '.join(scenario.flavours)}")
    first, last = scenario.first_seed, scenario.last_seed
    lines.append(f"  seeds  {first}" if first == last else f"  seeds  {first} .. {last}")
    started = _start(scenario.start)
    lines += [f"  start  {started}"] if started else []
    lines += [f"  {each.text}" for each in scenario.incidents]
    lines += [f"  expect {each.text}" for each in scenario.expectations]
    return "\n".join([*lines, "}", ""])


def _start(start: Start) -> str:
    """Return the values of the `start` line; empty if there are none."""
    said = []
    if start.battery is not None:
        said.append(f"battery = {display(start.battery, Dimension.RATIO)}")
    if start.wind_mm_s is not None:
        speed, gust = (display(each, Dimension.SPEED) for each in (start.wind_mm_s, start.gust_mm_s))
        said.append(f"wind(speed = {speed}, from = {start.wind_from_deg} deg, gust = {gust})")
    said += [f"{name}()" for name in ("camera", "gimbal") if getattr(start, name)]
    if start.utc_us is not None:
        moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=start.utc_us)
        said.append(f'at "{moment.isoformat().replace("+00:00", "Z")}"')
    return ", ".join(said)


def incident_text(when: When, fault: Fault, skills: Sequence[str]) -> str:
    """Return an incident as in `2 s after goto link_silence(for = 5 s)`; `skills` are those of the mission's steps."""
    return f"{_when(when, skills)} {fault_text(fault)}"


def fault_text(fault: Fault) -> str:
    """Return a fault as in `link_silence(for = 5 s, way = up)`; default values are omitted."""
    said = []
    for each in parameters(type(fault)):
        value = getattr(fault, each.field)
        if value is None or (not each.needed and value == type(fault).__dataclass_fields__[each.field].default):
            continue
        said.append(f"{each.name} = {_value(each, value)}")
    return f"{_NAMES[type(fault)]}({', '.join(said)})"


def _value(parameter: FaultField, value: object) -> str:
    unit = parameter.unit
    if isinstance(value, bool):
        return "yes" if value else "no"
    if unit is None or not isinstance(value, int):
        return str(value)
    if unit.dimension is Dimension.DURATION:
        return _time(value)
    return str(value) if unit.dimension is None else display(value * unit.canonical, unit.dimension)


def _when(when: When, skills: Sequence[str]) -> str:
    between = _time(when.from_us)
    if when.to_us != when.from_us:
        between += f" .. {_time(when.to_us)}"
    match when:
        case AtTime():
            return f"at {between}"
        case AfterStep(step):
            skill = skills[step]
            nth = skills[: step + 1].count(skill)
            named = skill if skills.count(skill) == 1 else f"{skill} {nth}"
            return f"{between} after {named}" if when.to_us else f"after {named}"
        case OnCondition(condition):
            return f"{between} after when {condition.text}" if when.to_us else f"when {condition.text}"


def _time(us: int) -> str:
    return display(us, Dimension.DURATION) if us else "0 s"
