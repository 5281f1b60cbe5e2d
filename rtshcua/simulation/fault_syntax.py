"""Parse and format faults as command lines write them: `wind,at=20s,speed=12m/s,from=270deg`."""

import re
from decimal import Decimal
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.diagnostics.suggest import nearest
from rtshcua.model.faults import KINDS, UNITS, WORD_TYPES, AgentFault, Fault, FaultField, HostFault, parameters

_QUANTITY = re.compile(r"(-?\d+(?:\.\d+)?)(\D*)", re.ASCII)
_AT = FaultField("at", "at_us", UNITS[0], (), False, False, True)
_COUNTED = {"shuffle": "the seed of the shuffled order"}
#: the kinds of faults that affect the simulated vehicle itself
OF_VEHICLE = {name: kind for name, kind in KINDS.items() if not issubclass(kind, HostFault | AgentFault)}


def parse_fault(text: str) -> Fault:
    """Return the fault that a text describes. Raise ValueError, with a message for the user, if it is malformed."""
    name, *pairs = text.split(",")
    kind = OF_VEHICLE.get(name)
    if kind is None:
        near = nearest(name, OF_VEHICLE)
        help = f"did you mean `{near}`?" if near else f"expected one of {', '.join(OF_VEHICLE)}"
        raise ValueError(f"no such fault: `{name}`; {help}")
    known = {each.name: each for each in (_AT, *parameters(kind))}
    values: dict[str, Any] = {}
    for pair in pairs:
        key, _, value = pair.partition("=")
        if key not in known:
            raise ValueError(f"`{name}` has no parameter `{key}`; expected one of {', '.join(known)}")
        values[known[key].field] = _value(known[key], value)
    missing = [key for key, each in known.items() if each.needed and each.field not in values]
    if missing:
        raise ValueError(f"`{name}` requires {', '.join(missing)}")
    return kind(**values)


def format_fault(fault: Fault) -> str:
    """Return the text of a fault; the inverse of `parse_fault`."""
    parts = [next(name for name, kind in OF_VEHICLE.items() if kind is type(fault)), f"at={fault.at_us}us"]
    for each in parameters(type(fault)):
        value = getattr(fault, each.field)
        if value is not None:
            parts.append(f"{each.name}={_written(each, value)}")
    return ",".join(parts)


def message_number(name: str) -> int:
    """Return the id of a MAVLink message. Raise ValueError if the dialect has no message of this name."""
    number = getattr(mavlink, f"MAVLINK_MSG_ID_{name}", None)
    if not isinstance(number, int):
        raise ValueError(f"no such message: `{name}`")
    return number


def _value(parameter: FaultField, text: str) -> object:
    if parameter.words:
        return _word(parameter, text)
    if parameter.is_count:
        if not text.isdecimal():
            raise ValueError(f"`{parameter.name}` must be a whole number ({_COUNTED[parameter.name]}), not `{text}`")
        return int(text)
    if parameter.unit is None:
        message_number(text)
        return text
    match = _QUANTITY.fullmatch(text)
    units = parameter.unit.words
    if match is None or match[2] not in units:
        raise ValueError(f"`{parameter.name}` must be a number with a unit ({', '.join(units)}), not `{text}`")
    return round(Decimal(match[1]) * units[match[2]])


def _written(parameter: FaultField, value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if parameter.unit is None:
        return str(value)
    assert isinstance(value, int)
    word, parts = min(parameter.unit.words.items(), key=lambda each: each[1])
    return f"{Decimal(value) / parts}{word}"


def _word(parameter: FaultField, text: str) -> object:
    if parameter.name == "held":
        if text not in parameter.words:
            raise ValueError(f"`held` must be yes or no, not `{text}`")
        return text == "yes"
    if text not in parameter.words:
        raise ValueError(f"no such {parameter.name}: `{text}`; expected one of {', '.join(parameter.words)}")
    return WORD_TYPES[parameter.name](text)
