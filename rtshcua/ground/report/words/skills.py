"""Skill contracts in words."""

from collections.abc import Iterator
from typing import Final

from rtshcua.ground.geometry.survey import DEFAULT_PATTERN
from rtshcua.ground.report.words.conditions import told_condition
from rtshcua.ground.report.words.values import between, told_value
from rtshcua.ground.report.words.vocabulary import Vocabulary, listed, name, named, sentence
from rtshcua.model.durability import WORDS as DURABILITIES
from rtshcua.model.ir.skills import ArgumentValue, Clause, LinkDecl, Motion, Parameter, SkillDecl
from rtshcua.model.quantity import Dimension, display

_TYPES: Final = {
    "zone": "a zone",
    "position": "a place on the ground",
    "altitude": "a height above home",
    "length": "a length",
    "speed": "a speed",
    "duration": "a duration",
    "ratio": "a part of a whole",
    "angle": "an angle",
    "voltage": "a voltage",
    "count": "a number",
    "role": "a role",
}
_CLASSES: Final = {
    "semantic": "Planned: there is time to think about it.",
    "tactical": "Tactical: it begins within seconds, or not at all.",
    "reflex": "Reflex: it begins at once, and only the vehicle itself may ask for it.",
}
#: of a skill that a chain ends in (decision/fallbacks.py and decision/decide.py)
AS_LINK: Final = (
    "As the last link of a chain it needs nothing: neither rules nor charge are asked. Asked for as a step, it is held "
    "against the rules (`degrade` too) and the charge as any other."
)
#: when a clause of each kind counts
_PARTS: Final = {
    "require": "before it begins",
    "assume": "before it begins, and all the while it runs",
    "maintain": "for the whole planned path, and all the while it runs",
}
#: what a survey flies (ground/geometry/survey.py)
PATTERNS: Final = {
    "grid": "back and forth on parallel lines along the longest edge, evenly spaced and no further apart than it flies "
    "high, or 5 m where it flies lower, in at most 256 lines; the first and the last are half a spacing inside. It "
    "begins at the end that is nearer to the entry of the area, where it has one, and goes around holes",
    "perimeter": "once around along the outer edge, counter-clockwise, from its westernmost corner; of a round area on "
    "16 straight legs, from the east. Holes are not gone around",
    "orbit": "once around the middle of the area, counter-clockwise, on 16 straight legs from the east, on the largest "
    "circle that lies in it and keeps clear of its edge; an area with a hole in the way has none",
}
#: docs/log-format.md, section 4
_DURABLE: Final = {
    "buffered": "its record is handed to the writer before it begins",
    "written": "its record is written to the file before it begins",
    "synced": "its record is written before it begins, and on the disk within a second",
    "synced_first": "its record is on the disk before it begins",
}


def told_motion(motion: Motion | None) -> str:
    """Where a skill takes the vehicle."""
    if motion is None:
        return "It does not say where it takes the vehicle."
    target, altitude = _given(motion.target), _given(motion.altitude)
    match motion.kind:
        case "climb":
            words = f"climbs straight up to {altitude}"
        case "fly":
            words = f"flies in a straight line to {target} at {altitude}"
        case "cover":
            words = f"flies a survey path over {target} at {altitude}"
        case "home":
            words = "flies home and lands there"
        case "hold":
            words = "stays where it is"
        case "land":
            words = "lands where it is"
    if motion.pattern is not None:
        words += f", in {_given(motion.pattern)}"
    if motion.speed is not None:
        words += f", with {_given(motion.speed)}"
    if motion.time is not None:
        words += f" for {_given(motion.time)}"
    return f"The vehicle {words}."


def told_patterns(skill: SkillDecl) -> Iterator[tuple[str, str]]:
    """The patterns that a survey may be flown in, each with what it flies; none where the skill flies no survey."""
    motion = skill.motion
    if motion is None or motion.kind != "cover":
        return
    wanted = None if motion.pattern is None else motion.pattern.text
    choices = [choice.text for each in skill.parameters if each.name.text == wanted for choice in each.choices]
    for pattern in choices or [DEFAULT_PATTERN]:
        yield pattern, PATTERNS[pattern]


def _given(parameter: object) -> str:
    text = getattr(parameter, "text", "")
    return f"the {name(text)} asked for" if text else "a place"


def told_parameter(parameter: Parameter, names: Vocabulary) -> tuple[str, str, str]:
    """What may be asked of a parameter, its limits, and what holds where nothing is said."""
    kind = parameter.type.text
    what = "a choice" if parameter.choices else _TYPES.get(kind, f"a value of {name(kind)}")
    limits = ""
    if parameter.choices:
        limits = named([choice.text for choice in parameter.choices], "or")
    elif parameter.range is not None:
        limits = f"between {between(parameter.range, names)}"
    default = "" if parameter.default is None else told_value(parameter.default, names)
    return what, limits, default


def told_timing(skill: SkillDecl) -> Iterator[str]:
    """When a skill may begin, how long a request for it is good, and how long it may last."""
    if skill.timing_class is not None:
        yield _CLASSES.get(skill.timing_class.text, sentence(f"of the class {name(skill.timing_class.text)}"))
    if skill.deadline is not None:
        yield f"It begins within {_duration(skill.deadline.value)} of its turn, or not at all."
    if skill.validity is not None:
        during = f", and only in the phase {named([each.text for each in skill.phases], 'or')}" if skill.phases else ""
        yield f"A request for it is good for {_duration(skill.validity.value)} after it was issued{during}."
    if skill.duration is not None:
        yield f"It lasts at most {_duration(skill.duration.value)}."
    if skill.grace is not None:
        yield f"While it runs, what must hold may be unknown for at most {_duration(skill.grace.value)}."
    if skill.energy is not None:
        yield f"It takes at most {display(skill.energy.value, skill.energy.dimension)} of a full charge."


def told_record(skill: SkillDecl) -> str:
    """What of it is recorded, and how durably."""
    kinds = [each.text for each in skill.record if each.text not in DURABILITIES]
    durable = [_DURABLE[each.text] for each in skill.record if each.text in DURABILITIES]
    words = f"Recorded are {listed([name(each) for each in kinds])}" if kinds else "Everything about it is recorded"
    return "; ".join([words, *durable]) + "."


def told_clause(clause: Clause, names: Vocabulary) -> str:
    """One condition of a contract."""
    words = told_condition(clause.condition, names)
    return f"{words} (where the vehicle has the sensors for it)" if clause.where_fitted else words


def told_left_out(part: str, clause: Clause, names: Vocabulary) -> str:
    """A condition that does not count for the vehicle, and when it would count for another."""
    return f"{told_condition(clause.condition, names)} ({_PARTS[part]})"


def told_link(link: LinkDecl, names: Vocabulary) -> str:
    """One link of a chain."""
    given = f" with {listed([told_argument(each, names) for each in link.arguments])}" if link.arguments else ""
    limit = "" if link.limit is None else f" for at most {_duration(link.limit.value)}"
    return f"{name(link.skill.text)}{given}{limit}"


def told_argument(argument: ArgumentValue, names: Vocabulary) -> str:
    """A value, and the parameter that it is for where that is written."""
    value = told_value(argument.value, names)
    return value if argument.name is None else f"{name(argument.name.text)} {value}"


def told_chain(links: tuple[LinkDecl, ...], names: Vocabulary) -> tuple[str, ...]:
    """What happens, in order: the first that can begin flies, then the next."""
    told = []
    for number, link in enumerate(links):
        words = told_link(link, names)
        before = "First" if number == 0 else "If that cannot begin, fails or its time is over"
        last = "; this needs nothing and always ends" if number == len(links) - 1 and number else ""
        told.append(f"{before}: {words}{last}.")
    return tuple(told)


def _duration(us: int) -> str:
    return display(us, Dimension.DURATION)
