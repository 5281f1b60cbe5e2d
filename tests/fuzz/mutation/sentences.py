"""Random sentences of the grammar, with the terminals that sources use."""

import re
from functools import cache
from random import Random

from lark import Lark
from lark.grammar import Rule

from fuzz import corpus
from fuzz.mutation.words import TOKEN, changed
from rtshcua.ground.language import generate

#: deeper derivations use the shortest rules
DEEPEST = 22
_CONDITIONS = ("condition", "disjunction", "atom", "timed", "comparison")
_ITEMS = (
    "declaration", "zone", "skill", "policy", "mission", "template", "signal", "vehicle", "enum", "skill_item",
    "policy_item", "mission_item", "phase_item", "vehicle_item", "zone_item", "signal_item", "rule", "step", "use",
)  # fmt: skip
_NEVER = 1 << 20
#: terminals that depend on the text after them, so that no single word matches
_LED = {
    "LOCAL_TIME": ["local time"], "_ONE_OF": ["one of"], "_ON_INADMISSIBLE": ["on inadmissible"], "_GROW": ["grow"],
    "_CIRCLE": ["circle"], "_POLYGON": ["polygon"], "_CORRIDOR": ["corridor"], "COMBINE": ["union", "difference"],
    "FUNCTION": ["abs", "min", "max"], "_REPEAT": ["repeat"], "_RISING": ["rising"], "_FALLING": ["falling"],
    "LINE_COMMENT": ["//\n"], "BLOCK_COMMENT": ["/**/"], "SPACE": [" "],
}  # fmt: skip


@cache
def grammar() -> Lark:
    """The grammar as Lark reads it."""
    return generate.lark(generate.GRAMMAR.read_text(encoding="utf-8"))


@cache
def _rules() -> dict[str, list[Rule]]:
    found: dict[str, list[Rule]] = {}
    for rule in grammar().rules:
        found.setdefault(rule.origin.name, []).append(rule)
    return found


@cache
def _samples() -> dict[str, list[str]]:
    """The words of all sources by terminal."""
    used = {token for source in corpus.sources() for token in TOKEN.findall(source.decode())}
    used |= {match for source in corpus.sources() for match in re.findall(r"[a-z_]+(?:\.[a-z_]+)+", source.decode())}
    found = {}
    for terminal in grammar().terminals:
        whole = re.compile(terminal.pattern.to_regexp())
        here = sorted(word for word in used if whole.fullmatch(word))
        found[terminal.name] = _LED.get(terminal.name) or here or [terminal.pattern.value]
    return found


@cache
def _depths() -> dict[str, int]:
    """The depth of the shortest derivation of each rule."""
    depths = dict.fromkeys(_rules(), _NEVER)
    for _ in range(len(depths)):
        for name, rules in _rules().items():
            depths[name] = 1 + min(
                max((depths.get(each.name, 0) for each in rule.expansion), default=0) for rule in rules
            )
    return depths


def sentence(of: Random, start: str = "file") -> str:
    """A sentence of one of the grammar's rules, with spaces between terminals."""
    words: list[str] = []
    _expand(start, of, 0, words)
    return " ".join(words)


def inserted(text: str, of: Random) -> str:
    """Insert a sentence in place of a similar part, or on some line."""
    if of.random() < 0.5:
        found = list(re.finditer(r"\b(?:require|assume|maintain|when|inside)\s+([^\n{}]+)", text))
        if found:
            one = of.choice(found)
            return text[: one.start(1)] + sentence(of, of.choice(_CONDITIONS)) + text[one.end(1) :]
    lines = text.split("\n")
    lines.insert(of.randrange(len(lines) + 1), sentence(of, of.choice(_ITEMS)))
    return "\n".join(lines)


def mutated(data: bytes, of: Random) -> bytes:
    """A near-valid source, after one to three changes."""
    text = data.decode("utf-8", errors="replace")
    for _ in range(of.choice([1, 1, 2, 3])):
        text = inserted(text, of) if of.random() < 0.25 else changed(text, of, 1)
    return text.encode(errors="replace")


def _expand(name: str, of: Random, depth: int, words: list[str]) -> None:
    rules = _rules()[name]
    if depth + _depths()[name] > DEEPEST:
        rules = [min(rules, key=lambda rule: max((_depths().get(each.name, 0) for each in rule.expansion), default=0))]
    for symbol in of.choice(rules).expansion:
        if symbol.name in _rules():
            _expand(symbol.name, of, depth + 1, words)
        else:
            words.append(of.choice(_samples()[symbol.name]))
