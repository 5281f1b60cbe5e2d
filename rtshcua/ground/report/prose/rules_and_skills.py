"""The rules of a policy, the contracts of skills and the signals of a vehicle in words."""

from collections.abc import Iterator, Sequence
from typing import Final

from rtshcua.ground.geometry.survey import DEFAULT_PATTERN
from rtshcua.ground.report.prose.condition_phrases import describe_condition
from rtshcua.ground.report.prose.phrases import (
    Vocabulary,
    between,
    describe_value,
    listed,
    name,
    named,
    quantity,
    sentence,
)
from rtshcua.model.durability import WORDS as DURABILITIES
from rtshcua.model.ir.expression import Quantity
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.policies import AirspaceDecl, Delegation, RuleDecl, Use
from rtshcua.model.ir.signals import EnumDecl, SignalDecl, SourceDecl
from rtshcua.model.ir.skills import (
    AcceptsDecl,
    ArgumentValue,
    ClauseDecl,
    EmitsDecl,
    FixedFieldDecl,
    LinkDecl,
    MotionDecl,
    ParameterDecl,
    PicturesDecl,
    SkillDecl,
    SourcedArgument,
    Substitute,
)
from rtshcua.model.quantity import Dimension, display, micrometres

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
#: about a skill at the end of a chain (decision/fallbacks.py and decision/decide.py)
AS_LINK: Final = (
    "As the last link of a chain it flies without any check of rules or charge. Requested as a step, it is checked "
    "against the rules (`degrade` too) and the charge like any other skill."
)
#: when a clause of each kind is checked
_PARTS: Final = {
    "require": "before it begins",
    "assume": "before it begins, and all the while it runs",
    "maintain": "for the whole planned path, and all the while it runs",
}
#: the path of each survey pattern (ground/geometry/survey.py)
PATTERNS: Final = {
    "grid": "back and forth on parallel lines along the longest edge, evenly spaced and no further apart than it flies "
    "high, or 5 m where it flies lower, in at most 256 lines; the first and the last are half a spacing inside. It "
    "begins at the end that is nearer to the entry of the area, where it has one, and goes around holes",
    "perimeter": "once around along the outer edge, counter-clockwise, from its westernmost corner; of a round area on "
    "16 straight legs, from the east. Holes are not gone around",
    "orbit": "once around the middle of the area, counter-clockwise, on 16 straight legs from the east, on the largest "
    "circle that lies in it and keeps clear of its edge; an area with a hole in the way has none",
    "corridor": "along the line of a corridor, to and fro on as many parallel lines as its width needs, evenly spaced "
    "as in a grid; outside of a bend a line has two corners, so that it stays in the corridor",
    "face": "once along a straight face, at the distance asked for to the left of its line, the camera to the right",
    "around": "once around the structure in the hole of the area, counter-clockwise, on 16 legs from the east, "
    "which touch the circle at the distance asked for from the smallest one around the middle of the structure that "
    "encloses it, with the camera to the middle",
}
#: the grid where the pictures state an overlap to the side
_BY_OVERLAP: Final = (
    "back and forth on parallel lines along the longest edge, evenly spaced and no further apart than the overlap of "
    "the pictures allows at the height, in at most 256 lines; the first and the last are half a spacing inside. It "
    "begins at the end that is nearer to the entry of the area, where it has one, and goes around holes"
)
#: docs/log-format.md, section 4
_DURABLE: Final = {
    "buffered": "its record is handed to the writer before it begins",
    "written": "its record is written to the file before it begins",
    "synced": "its record is written before it begins, and on the disk within a second",
    "synced_first": "its record is on the disk before it begins",
}


def describe_motion(motion: MotionDecl | None) -> str:
    """Describe where a skill takes the vehicle."""
    if motion is None:
        return "Its motion is not declared."
    target, altitude = _given(motion.target), _given(motion.altitude)
    match motion.kind:
        case "climb":
            words = f"climbs straight up to {altitude}"
        case "fly":
            words = f"flies in a straight line to {target} at {altitude}"
        case "cover":
            words = f"flies a survey path over {target} at {altitude}"
            if motion.lowest is not None:
                words = f"flies a survey path over {target} at each height from {_given(motion.lowest)} to {altitude}"
                words += ", evenly spaced"
                words += "" if motion.every is None else f" and at most {_given(motion.every)} apart"
        case "home":
            words = "flies home and lands there"
        case "hold":
            words = "stays where it is"
        case "land":
            words = "lands where it is"
    if motion.distance is not None:
        words += f", {_given(motion.distance)} away from a structure"
    if motion.pattern is not None:
        words += f", in {_given(motion.pattern)}"
    if motion.facing is not None:
        words += f", with its nose {motion.facing}, to the middle of the path"
    if motion.speed is not None:
        words += f", with {_given(motion.speed)}"
    if motion.time is not None:
        words += f" for {_given(motion.time)}"
    return f"The vehicle {words}."


def describe_patterns(skill: SkillDecl) -> Iterator[tuple[str, str]]:
    """Yield the patterns of a survey skill with their descriptions; nothing for other skills."""
    motion = skill.motion
    if motion is None or motion.kind != "cover":
        return
    wanted = None if motion.pattern is None else motion.pattern.text
    choices = [choice.text for each in skill.parameters if each.name.text == wanted for choice in each.choices]
    by_overlap = skill.pictures is not None and skill.pictures.side is not None
    for pattern in choices or [DEFAULT_PATTERN]:
        yield pattern, _BY_OVERLAP if by_overlap and pattern == "grid" else PATTERNS[pattern]


def describe_pictures(pictures: PicturesDecl | None) -> str:
    """Describe what the pictures of a survey must show, as proved; empty if the skill states none."""
    if pictures is None:
        return ""
    every = "" if pictures.every is None else f" every {display(pictures.every.value, pictures.every.dimension)}"
    kept = []
    if pictures.resolution_um is not None:
        kept.append(f"a pixel shows at most {micrometres(pictures.resolution_um)}")
    if pictures.forward is not None and pictures.side is not None:
        along, beside = _share(pictures.forward), _share(pictures.side)
        kept.append(f"pictures overlap by {along} along the path and {beside} beside it")
    if pictures.blur is not None:
        kept.append(f"they smear by at most {_share(pictures.blur)} of a pixel")
    if pictures.relief is not None and pictures.relief.value:
        relief = display(pictures.relief.value, Dimension.LENGTH)
        kept.append(f"for ground up to {relief} above or below home")
    proved = f"; proved before the flight: {listed(kept)}" if kept else ""
    return f" It takes pictures with the camera {name(pictures.camera.text)}{every}{proved}."


def _share(quantity: Quantity) -> str:
    return display(quantity.value, Dimension.RATIO)


def _given(parameter: object) -> str:
    text = getattr(parameter, "text", "")
    return f"the {name(text)} asked for" if text else "a place"


def describe_parameter(parameter: ParameterDecl, names: Vocabulary) -> tuple[str, str, str]:
    """Describe the type, the limits and the default of a parameter."""
    kind = parameter.type.text
    what = "a choice" if parameter.choices else _TYPES.get(kind, f"a value of {name(kind)}")
    limits = ""
    if parameter.choices:
        limits = named([choice.text for choice in parameter.choices], "or")
    elif parameter.range is not None:
        limits = f"between {between(parameter.range, names)}"
    default = "" if parameter.default is None else describe_value(parameter.default, names)
    return what, limits, default


def describe_timing(skill: SkillDecl) -> Iterator[str]:
    """Describe when a skill may begin, how long a request is valid, and how long it may last."""
    if skill.timing_class is not None:
        yield _CLASSES.get(skill.timing_class.text, sentence(f"of the class {name(skill.timing_class.text)}"))
    if skill.deadline is not None:
        yield f"It begins within {_duration(skill.deadline.value)} of its turn, or not at all."
    if skill.validity is not None:
        during = f", and only in the phase {named([each.text for each in skill.phases], 'or')}" if skill.phases else ""
        yield f"A request for it is valid for {_duration(skill.validity.value)} after it was issued{during}."
    if skill.duration is not None:
        yield f"It lasts at most {_duration(skill.duration.value)}."
    if skill.grace is not None:
        yield f"While it runs, what must hold may be unknown for at most {_duration(skill.grace.value)}."
    if skill.energy is not None:
        yield f"It takes at most {display(skill.energy.value, skill.energy.dimension)} of a full charge."


def describe_record(skill: SkillDecl) -> str:
    """Describe the recorded evidence and its durability."""
    kinds = [each.text for each in skill.record if each.text not in DURABILITIES]
    durable = [_DURABLE[each.text] for each in skill.record if each.text in DURABILITIES]
    words = f"Recorded are {listed([name(each) for each in kinds])}" if kinds else "Everything about it is recorded"
    return "; ".join([words, *durable]) + "."


def describe_clause(clause: ClauseDecl, names: Vocabulary) -> str:
    """Describe a clause of a contract."""
    words = describe_condition(clause.condition, names)
    return f"{words} (where the vehicle has the sensors for it)" if clause.where_fitted else words


def describe_left_out(part: str, clause: ClauseDecl, names: Vocabulary) -> str:
    """Describe a clause that does not apply to the vehicle, and when it would be checked."""
    return f"{describe_condition(clause.condition, names)} ({_PARTS[part]})"


def describe_link(link: LinkDecl, names: Vocabulary) -> str:
    """Describe a link of a chain."""
    arguments = f" with {listed([describe_argument(each, names) for each in link.arguments])}" if link.arguments else ""
    limit = "" if link.limit is None else f" for at most {_duration(link.limit.value)}"
    return f"{name(link.skill.text)}{arguments}{limit}"


def describe_argument(argument: ArgumentValue, names: Vocabulary) -> str:
    """Describe an argument, with the name of its parameter if it is written."""
    value = describe_value(argument.value, names)
    return value if argument.name is None else f"{name(argument.name.text)} {value}"


def describe_chain(links: tuple[LinkDecl, ...], names: Vocabulary) -> tuple[str, ...]:
    """Describe the links of a chain in order."""
    sentences = []
    for number, link in enumerate(links):
        words = describe_link(link, names)
        before = "First" if number == 0 else "If that cannot begin, fails or its time is over"
        last = "; this needs nothing and always ends" if number == len(links) - 1 and number else ""
        sentences.append(f"{before}: {words}{last}.")
    return tuple(sentences)


_ACCEPTED: Final = {
    "command": "the command", "item": "the mission item", "message": "the message", "mode": "the flight mode",
}  # fmt: skip
_DATUM: Final = {"home": " above home", "sea": " above sea", "frame": " in the frame that it names"}


def describe_accepted(skill: SkillDecl) -> Iterator[str]:
    """Describe what a MAVLink client sends for a skill, one item each."""
    yield from map(_accepted, skill.accepts)


def describe_emitted(skill: SkillDecl) -> Iterator[str]:
    """Describe what a skill sends to cameras, gimbals and other payload, one item each."""
    yield from map(_emitted, skill.emits)


def _emitted(emits: EmitsDecl) -> str:
    given = [
        f"{named([each.text for each in parameter.fields])} "
        + (quantity(parameter.value) if isinstance(parameter.value, Quantity) else name(parameter.value.name))
        for parameter in emits.parameters
    ]
    to = "the autopilot" if emits.addressee.text == "vehicle" else f"the {emits.addressee.text}"
    if isinstance(emits.every, Quantity):
        when = f"every {display(emits.every.value, emits.every.dimension)}"
    elif emits.each is not None:
        when = f"at each {emits.each.text}"
    else:
        when = "" if emits.once is None else f"at the {emits.once.text}"
    words = f"{when}, {name(emits.command.text)} to {to}{f' with {listed(given)}' if given else ''}"
    if emits.success is not None:
        limits = [f"within {display(each.value, each.dimension)}" for each in emits.success.limits]
        words += f"; success is an {emits.success.by.text} {' '.join(limits)}"
    return sentence(words + ("; if it fails, the step has failed" if emits.required else ""))


def _accepted(accepts: AcceptsDecl) -> str:
    autopilot = "" if accepts.autopilot is None else f" on {name(accepts.autopilot.text)}"
    where = [_fixed(each) for each in accepts.where]
    when = f", if {listed(where)}" if where else ""
    arguments = [_sourced(each) for each in accepts.arguments]
    given = f": {'; '.join(arguments)}" if arguments else ""
    return sentence(f"{_ACCEPTED[accepts.kind]} {name(accepts.name.text)}{autopilot}{when}{given}")


def _fixed(fixed: FixedFieldDecl) -> str:
    value = fixed.value.text
    if fixed.relation == "=":
        return f"{name(fixed.field.text)} is " + ("not given" if value == "unset" else name(value))
    bits = "has all bits of" if fixed.relation == "has" else "has no bit of"
    return f"{name(fixed.field.text)} {bits} {name(value)}"


def _sourced(source: SourcedArgument) -> str:
    datum = "" if source.datum is None else _DATUM[source.datum]
    values = [f"{listed([name(field.text) for field in source.fields])}{datum}"] if source.fields else []
    if source.substitute is not None:
        values.append(_substitute(source.substitute))
    return f"{name(source.parameter.text)} is {', or if that is not given '.join(values)}"


def _substitute(substitute: Substitute) -> str:
    if substitute.parameter is None:
        return "its default" if substitute.kind == "default" else "that at which the vehicle is"
    datum = "" if substitute.datum is None else _DATUM[substitute.datum]
    return f"the autopilot's {name(substitute.parameter.text)}{datum}"


def _duration(us: int) -> str:
    return display(us, Dimension.DURATION)


def describe_type(signal: SignalDecl) -> str:
    """Describe the type of a signal."""
    return _TYPES.get(signal.type.text, f"one of the states of {name(signal.type.text)}")


def describe_sources(signal: SignalDecl) -> str:
    """Describe the MAVLink fields of a signal."""
    words = listed([_source(each) for each in signal.sources], "or")
    words = words if len(signal.sources) == 1 else f"{words}, whichever is newer"
    if signal.every is None:
        return words
    return f"{words}; its sender reports it every {display(signal.every.value, Dimension.DURATION)}"


def _source(source: SourceDecl) -> str:
    where = listed([f"{name(each.field.text)} is {name(each.value.text)}" for each in source.where])
    words = f"{name(source.message.text)} field {listed([name(field.text) for field in source.fields])}"
    return f"{words}, where {where}" if where else words


def describe_unknown(signal: SignalDecl) -> str:
    """Describe when a signal is unknown."""
    stale = f"when older than {display(signal.stale_after.value, Dimension.DURATION)}"
    if not signal.unknown_at:
        return stale
    return f"{stale}, and when it reads {listed([name(each.text) for each in signal.unknown_at], 'or')}"


def describe_members(enum: EnumDecl) -> str:
    """Describe the states of an enumeration in order, with their numbers."""
    return ", ".join(
        f"{name(each.name.text)} ({each.value})" for each in sorted(enum.members, key=lambda one: one.value)
    )


#: the descriptions of the sources of requests
SOURCES: Final = {
    "agent": "an agent",
    "operator": "a person at the controls",
    "onboard": "software on board",
    "reflex": "a reflex on board",
}


def sources_of(rule: RuleDecl) -> tuple[str, ...]:
    """The sources of a rule: the written ones, or the default."""
    if rule.through:
        return tuple(source.text for source in rule.through)
    narrow = rule.kind == "permit" and rule.roles
    return ("operator",) if narrow else tuple(SOURCES)


def through(sources: Sequence[str]) -> str:
    """Describe sources."""
    if set(SOURCES) <= set(sources):
        return "any source"
    return listed([SOURCES.get(source, name(source)) for source in sources], "or")


def describe_rule(rule: RuleDecl, names: Vocabulary) -> str:
    """Describe a rule in a sentence, with the template or delegation that made it."""
    words = _rule(rule, names)
    if rule.where_fitted:
        words = f"{words} (where the vehicle has the sensors for it)"
    for origin in reversed(rule.origin):
        words = f"{_origin(origin, names)}, {words}"
    return sentence(words)


def _rule(rule: RuleDecl, names: Vocabulary) -> str:
    skills = skills_of(rule.skills)
    when = "" if rule.when is None else f", if {describe_condition(rule.when, names)}"
    match rule.kind:
        case "permit":
            whom = f"the role {named(_texts(rule.roles), 'or')}" if rule.roles else "anyone"
            return f"{whom} may have {skills} done, asking through {through(sources_of(rule))}{when}"
        case "forbid":
            asked = f", asking through {through(sources_of(rule))}" if rule.through else ""
            whom = "nobody" if not rule.roles else f"the role {named(_texts(rule.roles), 'or')}"
            return f"{whom} may{' not' if rule.roles else ''} have {skills} done{asked}{when}"
        case "confirm":
            return f"{skills} must be approved by {approver(rule)}{when}"
        case "degrade":
            instead = "" if rule.target is None else describe_link(rule.target, names)
            return f"{instead} is flown instead of {_replaced(rule)}{when}"


def approver(rule: RuleDecl) -> str:
    """Describe who confirms, and the time limit."""
    who = "somebody" if rule.approver is None else f"a person of the role {name(rule.approver.text)}"
    if rule.another is not None:
        who += f" and by another person of the role {name(rule.another.text)}"
    if rule.within is None:
        return who
    return f"{who} (within {display(rule.within.value, Dimension.DURATION)}, or it is denied)"


def skills_of(skills: Sequence[Name]) -> str:
    """Describe the skills of a rule; an empty list means all skills."""
    return named(_texts(skills), "or") if skills else "any skill"


def _replaced(rule: RuleDecl) -> str:
    """Describe the skills that a `degrade` replaces, which never include its own target (`decision/prepare.py`)."""
    target = "" if rule.target is None else rule.target.skill.text
    left = [skill for skill in rule.skills if skill.text != target]
    if not rule.skills:
        return "any other skill"
    return skills_of(left) if left else "nothing else"


def describe_airspace(airspace: AirspaceDecl | None) -> str:
    """Describe the airspace of a policy."""
    if airspace is None:
        return describe_limits((), ())
    return describe_limits(_texts(airspace.inside), _texts(airspace.outside))


def describe_limits(inside: Sequence[str], outside: Sequence[str]) -> str:
    """Describe an airspace by the names of its zones."""
    if not inside and not outside:
        return "This policy does not limit where the vehicle may be, except by its rules and skills."
    parts = []
    if inside:
        parts.append(f"inside of {_all(inside)}")
    if outside:
        parts.append(f"outside of {_all(outside)}")
    return f"The vehicle may only be {' and '.join(parts)}: for every planned path, and at every moment in flight."


def _all(zones: Sequence[str]) -> str:
    return named(zones) if len(zones) == 1 else f"each of ({named(zones)})"


def describe_evidence(without: str) -> str:
    """Describe what happens if the records of a flight cannot be kept."""
    if without == "refuse":
        return "If the records of a flight cannot be kept, the running step may finish, and no further step begins."
    return "If the records of a flight cannot be kept, the mission is aborted and the vehicle comes down."


def describe_silence(limit_us: int, then: str) -> str:
    """Describe what happens after a long silence of the vehicle."""
    again = "when it is heard again and its state is fresh"
    if then == "continue":
        follows = f"the step goes on {again}, as long as all that it needs holds"
    else:
        follows = f"the mission is aborted {again}, and the contingency flies"
    limit = display(limit_us, Dimension.DURATION)
    return f"If the vehicle was silent for longer than {limit}, {follows}. A shorter silence ends nothing."


def _origin(origin: Node, names: Vocabulary) -> str:
    match origin:
        case Use():
            given = [
                f"{'' if each.name is None else f'{name(each.name.text)} = '}{describe_value(each.value, names)}"
                for each in origin.arguments
            ]
            return f"by the template {name(origin.template.text)}" + (f" ({', '.join(given)})" if given else "")
        case Delegation():
            return describe_delegation(origin, names)
        case _:
            return "by what is used here"


def describe_delegation(one: Delegation, names: Vocabulary) -> str:
    """Describe a delegation, as a prefix of the rule that it makes."""
    asked = f" through {through(_texts(one.through))}" if one.through else ""
    when = "" if one.when is None else f" (if {describe_condition(one.when, names)})"
    grantor, grantee = name(one.grantor.text), name(one.grantee.text)
    return f"by delegation of {skills_of(one.skills)} from {grantor} to {grantee}{asked}{when}"


def _texts(names: Sequence[Name]) -> list[str]:
    return [each.text for each in names]
