"""What is asked at a place of an unfinished text: the tokens that the parser would take, and what a name is for."""

from enum import Enum
from typing import NamedTuple

from rtshcua.diagnostics.span import Source
from rtshcua.ground.editor.pieces import Cut
from rtshcua.ground.editor.syntax import Token, tokens
from rtshcua.ground.language.automaton import Automaton
from rtshcua.ground.language.build.reader import Enough, Reader
from rtshcua.ground.language.expected import accepted, phrase
from rtshcua.ground.language.parse import beginning
from rtshcua.ground.language.recovery import misread, resume, shifts
from rtshcua.ground.language.table import table

_BEGINNINGS = frozenset(word for word in table().words if shifts(table().rows[0], word))
_STOP = "\x01"  # at which no token begins, so the parser stops there with its stacks as they are


class Wanted(Enum):
    """What a name at a place is for."""

    NOTHING = "a new name"
    SKILL = "skill"
    STEP = "step"
    ZONE = "zone"
    VALUE = "value"
    COMPARED = "what is compared with"
    ARGUMENT = "argument"
    POLICY = "policy"
    VEHICLE = "vehicle"
    TEMPLATE = "template"
    NOMINAL = "nominal"
    ROLE = "role"
    SOURCE = "source"
    CLASS = "class"
    RECORD = "record"
    PHASE = "phase"
    TYPE = "type"
    MESSAGE = "message"
    PARAMETER = "parameter"
    SIGNAL = "signal"
    REASON = "reason"
    DIALECT_ENUM = "dialect enum"
    MISSION = "mission"
    AUTOPILOT = "autopilot"
    ENDING = "ending"
    DAY = "day of the week"


class Asked(NamedTuple):
    """The symbols that the parser would take, and the words of the language among them as they are written."""

    symbols: frozenset[str]
    words: tuple[str, ...]


class Call(NamedTuple):
    """The innermost call that a place stands in: its name, the arguments before, and the name of the present one."""

    name: str
    position: int
    argument: str | None
    named: tuple[str, ...]


#: what stands behind a word, until another of them
_BEHIND = {
    "under": Wanted.POLICY, "on": Wanted.VEHICLE, "use": Wanted.TEMPLATE, "from": Wanted.NOMINAL,
    "permit": Wanted.SKILL, "forbid": Wanted.SKILL, "confirm": Wanted.SKILL, "degrade": Wanted.SKILL,
    "delegate": Wanted.SKILL, "fallback": Wanted.SKILL, "contingency": Wanted.SKILL, "to": Wanted.SKILL,
    "through": Wanted.SOURCE, "role": Wanted.ROLE, "class": Wanted.CLASS, "record": Wanted.RECORD,
    "during": Wanted.PHASE, "inside": Wanted.ZONE, "outside": Wanted.ZONE, "airspace": Wanted.ZONE,
    "when": Wanted.VALUE, "require": Wanted.VALUE, "assume": Wanted.VALUE, "maintain": Wanted.VALUE,
    "and": Wanted.VALUE, "or": Wanted.VALUE, "not": Wanted.VALUE, "rising": Wanted.VALUE, "falling": Wanted.VALUE,
    "without": Wanted.SIGNAL, "sizes": Wanted.SKILL,
    "given": Wanted.SIGNAL, "table": Wanted.SIGNAL, "because": Wanted.REASON, "motion": Wanted.PARAMETER,
    "by": Wanted.SOURCE, "union": Wanted.ZONE, "difference": Wanted.ZONE, "grow": Wanted.ZONE,
    "policy": Wanted.NOTHING, "mission": Wanted.NOTHING, "skill": Wanted.NOTHING, "zone": Wanted.NOTHING,
    "signal": Wanted.NOTHING, "enum": Wanted.NOTHING, "vehicle": Wanted.NOTHING, "template": Wanted.NOTHING,
    "nominal": Wanted.NOTHING, "phase": Wanted.NOTHING,
    "flies": Wanted.MISSION, "aboard": Wanted.AUTOPILOT, "ends": Wanted.ENDING, "after": Wanted.SKILL,
    "never": Wanted.SKILL, "lands": Wanted.ZONE, "distance": Wanted.ZONE,
}  # fmt: skip


def asked(cut: Cut, offset: int) -> Asked:
    """What the parser would take at a place, given all that stands before it."""
    text = cut.source.text[:offset] + _STOP
    start = max((piece.start for piece in cut.pieces if piece.firm and piece.start < offset), default=None)
    source = Source(cut.source.file, text)
    automaton = Automaton(Reader(source))
    at: int | None = beginning(source) if start is None else start
    try:
        while at is not None:
            failure = automaton.run(at)
            if failure is None:
                break
            if failure.start >= offset:
                symbols = accepted(automaton)
                words = (phrase(automaton, each) for each in symbols if each.replace("_", "").isalpha())
                return Asked(frozenset(symbols), tuple(sorted(words)))
            at = resume(automaton, misread(automaton, failure).start)
    except Enough:
        pass
    return Asked(frozenset(), ())


def before(text: str, offset: int, since: int) -> list[Token]:
    """The tokens of the declaration that a place is in, without comments. One that is not whole is told by its first
    word at the beginning of a line.
    """
    found = [token for token in tokens(text, since, offset) if token.kind != "comment" and token.end <= offset]
    begins = (at for at, token in enumerate(found) if token.text in _BEGINNINGS and text[token.start - 1] == "\n")
    return found[max(begins, default=0) :]


def wanted(written: list[Token]) -> Wanted:
    """What a name is for behind these tokens."""
    last = written[-1].text if written else ""
    if last in ("==", "!=", "<", "<=", ">", ">="):
        return Wanted.COMPARED
    head = written[0].text if written else ""
    if head in ("signal", "enum"):
        return _of_signal(written, head)
    call = call_of(written)
    if call is not None:
        return _within(written, call, last)
    depth = 0
    for number, token in enumerate(reversed(written)):
        if token.text in (")", "}"):
            depth += 1
        elif token.text in ("(", "{"):
            if depth == 0:
                return _in_block(written[: len(written) - number], last)
            depth -= 1
        elif depth == 0 and token.kind == "word" and token.text in _BEHIND:
            follows = written[len(written) - number : len(written) - number + 1]
            if token.text == "phase" and follows and follows[0].text == "in":
                return Wanted.PHASE
            return _behind(written, len(written) - 1 - number)
    return Wanted.VALUE


def _behind(written: list[Token], at: int) -> Wanted:
    """What stands behind a word, which may depend on the word before it."""
    word, before_it = written[at].text, written[at - 1].text if at else ""
    if word == "on":
        header = written[0].text == "mission" and all(token.text != "{" for token in written)
        return Wanted.VEHICLE if header or written[0].text == "nominal" else Wanted.DAY
    if word == "flies" and before_it == "expect":
        return Wanted.SKILL
    return Wanted.ZONE if word == "to" and before_it == "distance" else _BEHIND[word]


def _of_signal(written: list[Token], head: str) -> Wanted:
    marks = {token.text for token in written}
    if head == "enum":
        return Wanted.DIALECT_ENUM if "=" in marks and "{" not in marks else Wanted.NOTHING
    if "=" in marks:
        return Wanted.COMPARED if "unknown" in marks else Wanted.MESSAGE
    return Wanted.TYPE if ":" in marks else Wanted.NOTHING


def _within(written: list[Token], call: Call, last: str) -> Wanted:
    if call.name in ("union", "difference", "grow", "circle", "polygon", "corridor"):
        return Wanted.ZONE
    if call.name in ("abs", "min", "max", "and", "or", "when", "require", "assume", "maintain", "not"):
        return Wanted.VALUE
    header = written[0].text in ("skill", "template", "mission") and not any(each.text == "{" for each in written)
    if header:
        return Wanted.TYPE if last == ":" else Wanted.NOTHING
    return Wanted.ARGUMENT


def _in_block(outer: list[Token], last: str) -> Wanted:
    """In `{ }`, where no word tells: the steps of a phase, the members that are compared with, the cells of a table."""
    said = [token.text for token in outer if token.kind == "word"][-2:]
    if "phase" in said[:1] or "repeat" in said:
        return Wanted.STEP
    return Wanted.COMPARED if "in" in said else Wanted.VALUE


def sizing(written: list[Token]) -> bool:
    """Whether a place is among the sizes that a program gives to a skill."""
    return bool(written) and written[0].text == "sizes"


def call_of(written: list[Token]) -> Call | None:
    """The innermost call that is open."""
    depth, position, argument = 0, 0, None
    named: list[str] = []
    for number in range(len(written) - 1, -1, -1):
        text = written[number].text
        if text in (")", "}"):
            depth += 1
        elif text == "{":
            if depth == 0:
                return None
            depth -= 1
        elif text == "(":
            if depth == 0:
                name = written[number - 1] if number else None
                return None if name is None or name.kind != "word" else Call(name.text, position, argument, (*named,))
            depth -= 1
        elif depth == 0 and text == ",":
            position += 1
        elif depth == 0 and text == "=" and number:
            named.append(written[number - 1].text)
            if position == 0:
                argument = written[number - 1].text
    return None
