"""Near-valid sources: changes of words, lines, parts or whole declarations."""

import re
from collections.abc import Callable
from functools import cache
from random import Random

from fuzz import corpus
from rtshcua.ground.language.table import table

TOKEN = re.compile(
    r"\s+|//[^\n]*|/\*.*?\*/|\"[^\"\n]*\"|\d[\d_]*(?:\.\d+)?|[A-Za-z_][\w]*|<=|>=|==|!=|\.\.|.", re.DOTALL
)
_NUMBERS = ("0", "1", "2", "3", "7", "10", "59", "60", "90", "100", "180", "360", "0.5", "0.001", "1e3", "4294967296",
            "9223372036854775807", "99999999999999999999", "47.398", "8.545")  # fmt: skip
_UNITS = ("m", "km", "mm", "m/s", "km/h", "s", "ms", "min", "h", "%", "N", "S", "E", "W", "deg", "MSL", "")
_MARKS = ("(", ")", "{", "}", ",", "..", "<", "<=", "==", "!=", ">", ">=", "+", "-", "*", "/", ".", "=", "@", ":")
_DECLARATIONS = re.compile(r"^(?=(?:zone|skill|signal|enum|policy|mission|vehicle|template|import)\b)", re.MULTILINE)


@cache
def _pool() -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Declarations, lines and names of all sources."""
    texts = [source.decode() for source in corpus.sources()]
    declarations = [each for text in texts for each in _DECLARATIONS.split(text)]
    lines = sorted({line for text in texts for line in text.splitlines() if line.strip()})
    names = sorted(
        {token for text in texts for token in TOKEN.findall(text) if token[0].isalpha()} | set(table().words)
    )
    return tuple(declarations), tuple(lines), tuple(names)


def _number(text: str, of: Random) -> str:
    if of.random() < 0.5:
        return of.choice(_NUMBERS)
    try:
        return str(max(0, round(float(text.replace("_", "")) * of.choice([0.1, 0.5, 0.9, 1.1, 2, 10, 1000]))))
    except (ValueError, OverflowError):
        return "1"


def _by_token(text: str, of: Random) -> str:
    tokens = TOKEN.findall(text)
    places = [at for at, token in enumerate(tokens) if not token.isspace()]
    if not places:
        return of.choice(_pool()[2])
    at = of.choice(places)
    token = tokens[at]
    match of.randrange(6):
        case 0:
            tokens[at] = ""
        case 1:
            tokens[at] = f"{token} {token}"
        case 2:
            other = of.choice(places)
            tokens[at], tokens[other] = tokens[other], token
        case 3:
            tokens[at] = f"{token} {of.choice([*_MARKS, *_pool()[2]])}"
        case _:
            if token[0].isdigit():
                tokens[at] = _number(token, of)
            elif token in _UNITS:
                tokens[at] = of.choice(_UNITS)
            elif token[0].isalpha():
                near = [tokens[each] for each in places if tokens[each][0].isalpha()]
                tokens[at] = of.choice(near if of.random() < 0.7 else _pool()[2])
            else:
                tokens[at] = of.choice(_MARKS)
    return "".join(tokens)


def _by_number(text: str, of: Random) -> str:
    """Change one number, or its unit."""
    found = list(re.finditer(r"(\d[\d_]*(?:\.\d+)?)( ?)([A-Za-z%/]*)", text))
    if not found:
        return text
    one = of.choice(found)
    number, unit = one[1], one[3]
    if of.random() < 0.7:
        number = _number(number, of)
    else:
        unit = of.choice(_UNITS)
    return f"{text[: one.start()]}{number}{one[2]}{unit}{text[one.end() :]}"


def _by_line(text: str, of: Random) -> str:
    lines = text.split("\n")
    at, other = of.randrange(len(lines)), of.randrange(len(lines))
    match of.randrange(5):
        case 0:
            del lines[at]
        case 1:
            lines.insert(other, lines[at])
        case 2:
            lines[at], lines[other] = lines[other], lines[at]
        case 3:
            lines[at] = of.choice(_pool()[1])
        case _:
            lines.insert(at, of.choice(_pool()[1]))
    return "\n".join(lines)


def _by_declaration(text: str, of: Random) -> str:
    parts = _DECLARATIONS.split(text)
    at, other = of.randrange(len(parts)), of.randrange(len(parts))
    match of.randrange(4):
        case 0:
            del parts[at]
        case 1:
            parts.insert(other, parts[at])
        case 2:
            parts[at], parts[other] = parts[other], parts[at]
        case _:
            parts.insert(at, of.choice(_pool()[0]))
    return "".join(parts)


_WAYS: tuple[Callable[[str, Random], str], ...] = (
    _by_token, _by_token, _by_token, _by_number, _by_number, _by_line, _by_line, _by_declaration,
)  # fmt: skip


def changed(text: str, of: Random, times: int) -> str:
    """The text after a number of changes."""
    for _ in range(times):
        text = of.choice(_WAYS)(text, of)
    return text
