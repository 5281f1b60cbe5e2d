"""The context of the cursor in an unfinished text: the tokens that the parser accepts, and the use of a name."""

from collections.abc import Iterator
from enum import Enum
from typing import NamedTuple

from rtshcua.diagnostics.span import Source
from rtshcua.ground.editor.incremental_parse import ParsedText
from rtshcua.ground.editor.syntax import Token, tokens
from rtshcua.ground.language.automaton import Automaton
from rtshcua.ground.language.build.reader import Enough, Reader
from rtshcua.ground.language.expected import accepted, phrase
from rtshcua.ground.language.parse import beginning
from rtshcua.ground.language.recovery import misread, resume, shifts
from rtshcua.ground.language.table import table

_BEGINNINGS = frozenset(word for word in table().words if shifts(table().rows[0], word))
_STOP = "\x01"  # no token begins with it, so the parser stops there


class NameUse(Enum):
    """The use of a name at the cursor."""

    NOTHING = "a new name"
    SKILL = "skill"
    STEP = "step"
    ZONE = "zone"
    VALUE = "value"
    COMPARED = "compared value"
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
    CAMERA = "camera"
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
    COMMAND = "command"
    MODE = "flight mode"
    FIELD = "field"


class AcceptedSymbols(NamedTuple):
    """The symbols that the parser accepts, and the keywords among them."""

    symbols: frozenset[str]
    words: tuple[str, ...]


class OpenCall(NamedTuple):
    """The innermost call around the cursor: its name, the number of earlier arguments, the name of the present
    argument, and all argument names.
    """

    name: str
    position: int
    argument: str | None
    named: tuple[str, ...]


#: the use of a name after a keyword, up to the next of these keywords
_BEHIND = {
    "under": NameUse.POLICY, "on": NameUse.VEHICLE, "use": NameUse.TEMPLATE, "from": NameUse.NOMINAL,
    "permit": NameUse.SKILL, "forbid": NameUse.SKILL, "confirm": NameUse.SKILL, "degrade": NameUse.SKILL,
    "delegate": NameUse.SKILL, "fallback": NameUse.SKILL, "contingency": NameUse.SKILL, "to": NameUse.SKILL,
    "through": NameUse.SOURCE, "role": NameUse.ROLE, "class": NameUse.CLASS, "record": NameUse.RECORD,
    "during": NameUse.PHASE, "inside": NameUse.ZONE, "outside": NameUse.ZONE, "airspace": NameUse.ZONE,
    "when": NameUse.VALUE, "require": NameUse.VALUE, "assume": NameUse.VALUE, "maintain": NameUse.VALUE,
    "and": NameUse.VALUE, "or": NameUse.VALUE, "not": NameUse.VALUE, "rising": NameUse.VALUE, "falling": NameUse.VALUE,
    "without": NameUse.SIGNAL, "sizes": NameUse.SKILL,
    "given": NameUse.SIGNAL, "table": NameUse.SIGNAL, "because": NameUse.REASON, "motion": NameUse.PARAMETER,
    "by": NameUse.SOURCE, "union": NameUse.ZONE, "difference": NameUse.ZONE, "grow": NameUse.ZONE,
    "policy": NameUse.NOTHING, "mission": NameUse.NOTHING, "skill": NameUse.NOTHING, "zone": NameUse.NOTHING,
    "signal": NameUse.NOTHING, "enum": NameUse.NOTHING, "vehicle": NameUse.NOTHING, "template": NameUse.NOTHING,
    "nominal": NameUse.NOTHING, "phase": NameUse.NOTHING,
    "flies": NameUse.MISSION, "aboard": NameUse.AUTOPILOT, "ends": NameUse.ENDING, "after": NameUse.SKILL,
    "never": NameUse.SKILL, "lands": NameUse.ZONE, "distance": NameUse.ZONE,
}  # fmt: skip

#: the use of a name after two keywords
_BEHIND_TWO = {
    ("pictures", "by"): NameUse.CAMERA, ("expect", "flies"): NameUse.SKILL, ("distance", "to"): NameUse.ZONE,
}  # fmt: skip


def last_declaration_start(text: ParsedText, offset: int) -> int:
    """The start of the last declaration before an offset at which the parser may start."""
    return max((piece.start for piece in text.pieces if piece.firm and piece.start <= offset), default=0)


def accepted_symbols(cut: ParsedText, offset: int) -> AcceptedSymbols:
    """Return the symbols that the parser accepts at an offset."""
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
                return AcceptedSymbols(frozenset(symbols), tuple(sorted(words)))
            at = resume(automaton, misread(automaton, failure).start)
    except Enough:
        pass
    return AcceptedSymbols(frozenset(), ())


def tokens_before(text: str, offset: int, since: int) -> list[Token]:
    """The tokens before an offset in its declaration, without comments. An incomplete declaration is found by its first
    keyword at the beginning of a line.
    """
    found = [token for token in tokens(text, since, offset) if token.kind != "comment" and token.end <= offset]
    begins = (at for at, token in enumerate(found) if token.text in _BEGINNINGS and text[token.start - 1] == "\n")
    return found[max(begins, default=0) :]


def name_use(written: list[Token]) -> NameUse:
    """Return the use of a name after these tokens."""
    if not written:
        return NameUse.VALUE
    head, last = written[0].text, written[-1].text
    if last in ("==", "!=", "<", "<=", ">", ">="):
        return NameUse.COMPARED
    if head in ("signal", "enum"):
        return _of_signal(written, head)
    accepts = accepts_before(written)
    if accepts:
        return _in_accepts(accepts)
    emits = accepts_before(written, "emits")
    if emits:
        return _in_emits(emits)
    call = open_call(written)
    if call is not None:
        return _in_call(written, call, last)
    for at, token in _unclosed(written):
        if token.text in ("(", "{"):
            return _in_block(written[: at + 1])
        if token.kind == "word" and token.text in _BEHIND:
            return _behind_word(written, at)
    return NameUse.VALUE


#: the keywords at which an `accepts` before the cursor has ended
_OTHER_PARTS = frozenset(
    ("motion", "class", "deadline", "valid", "lasts", "grace", "require", "assume", "maintain", "fallback", "energy",
     "record", "accepts", "emits", "pictures", "{", "}")
)  # fmt: skip


def accepts_before(written: list[Token], part: str = "accepts") -> list[Token]:
    """The tokens of the `accepts`, or the `emits`, that contains the cursor; empty if there is none."""
    for at in range(len(written) - 1, -1, -1):
        if written[at].text == part:
            return written[at:]
        if written[at].text in _OTHER_PARTS:
            break
    return []


def _in_accepts(written: list[Token]) -> NameUse:
    """Return the use of a name in an `accepts`: of a command, a parameter of the skill, or a field."""
    texts = [token.text for token in written]
    last = texts[-1]
    after = {"accepts": NameUse.COMMAND, "item": NameUse.COMMAND, "message": NameUse.MESSAGE, "mode": NameUse.MODE,
             "on": NameUse.AUTOPILOT, "where": NameUse.FIELD, "and": NameUse.FIELD, "with": NameUse.PARAMETER,
             "(": NameUse.FIELD}  # fmt: skip
    if last == ",":
        return NameUse.FIELD if texts.count("(") > texts.count(")") else NameUse.PARAMETER
    if last == "=":
        return NameUse.FIELD if "with" in texts else NameUse.NOTHING
    return after.get(last, NameUse.NOTHING)


def _in_emits(written: list[Token]) -> NameUse:
    """Return the use of a name in an `emits`: of a command, its parameter, or a parameter of the skill."""
    last = written[-1].text
    if last == "=":
        return NameUse.PARAMETER
    in_list = last == "," and "with" in [token.text for token in written]
    return (
        NameUse.COMMAND if last == "emits" else NameUse.FIELD if in_list or last in ("with", "(") else NameUse.NOTHING
    )


def _unclosed(written: list[Token]) -> Iterator[tuple[int, Token]]:
    """The tokens from the last to the first, without closed brackets and their content."""
    depth = 0
    for at in range(len(written) - 1, -1, -1):
        token = written[at]
        if token.text in (")", "}"):
            depth += 1
        elif depth == 0:
            yield at, token
        elif token.text in ("(", "{"):
            depth -= 1


def _behind_word(written: list[Token], at: int) -> NameUse:
    """Return the use of a name after a keyword, which may depend on the tokens around it."""
    word, before_it = written[at].text, written[at - 1].text if at else ""
    if word == "phase" and [token.text for token in written[at + 1 : at + 2]] == ["in"]:
        return NameUse.PHASE
    if word == "on":
        header = written[0].text == "mission" and all(token.text != "{" for token in written)
        return NameUse.VEHICLE if header or written[0].text == "nominal" else NameUse.DAY
    if word == "distance" and written[0].text == "skill":
        return NameUse.PARAMETER
    return _BEHIND_TWO.get((before_it, word), _BEHIND[word])


def _of_signal(written: list[Token], head: str) -> NameUse:
    marks = {token.text for token in written}
    if head == "enum":
        return NameUse.DIALECT_ENUM if "=" in marks and "{" not in marks else NameUse.NOTHING
    if "=" in marks:
        return NameUse.COMPARED if "unknown" in marks else NameUse.MESSAGE
    return NameUse.TYPE if ":" in marks else NameUse.NOTHING


def _in_call(written: list[Token], call: OpenCall, last: str) -> NameUse:
    if call.name in ("union", "difference", "grow", "circle", "polygon", "corridor"):
        return NameUse.ZONE
    if call.name in ("abs", "min", "max", "and", "or", "when", "require", "assume", "maintain", "not"):
        return NameUse.VALUE
    header = written[0].text in ("skill", "template", "mission") and not any(each.text == "{" for each in written)
    if header:
        return NameUse.TYPE if last == ":" else NameUse.NOTHING
    return NameUse.ARGUMENT


def _in_block(outer: list[Token]) -> NameUse:
    """Return the use of a name in `{ }`: a step of a phase, a compared member, or a cell of a table."""
    words = [token.text for token in outer if token.kind == "word"][-2:]
    if "phase" in words[:1] or "repeat" in words:
        return NameUse.STEP
    return NameUse.COMPARED if "in" in words else NameUse.VALUE


def in_sizes(written: list[Token]) -> bool:
    """Whether the tokens are a `sizes` declaration."""
    return bool(written) and written[0].text == "sizes"


def open_call(written: list[Token]) -> OpenCall | None:
    """Return the innermost open call; None if there is none in the innermost block."""
    position, argument = 0, None
    named: list[str] = []
    for at, token in _unclosed(written):
        name = written[at - 1] if at else None
        if token.text == "{":
            return None
        if token.text == "(":
            called = name is not None and name.kind == "word"
            return OpenCall(name.text, position, argument, (*named,)) if name is not None and called else None
        if token.text == ",":
            position += 1
        elif token.text == "=" and name is not None:
            named.append(name.text)
            argument = name.text if position == 0 else argument
    return None
