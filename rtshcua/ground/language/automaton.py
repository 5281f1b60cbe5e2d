"""The LALR parser: reads a token, shifts it or reduces, and stops at the first token that does not fit.

Lark's own driver makes an object for each token and a tree for each rule. This driver keeps offsets and passes the
parts of a rule directly to its action. When it stops, it keeps its stacks, so that `recovery` can continue.

It is the fast counterpart of Lark's driver: text to IR takes 0.34 of the time of a bare Lark parse (bench/parse.py;
docs/adr/0006 and 0037). tests/unit/ground/language/test_any_text.py checks that both accept the same texts.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from types import MethodType
from typing import Any, NamedTuple

from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.language.build.actions import ACTIONS
from rtshcua.ground.language.build.reader import Action, Reader
from rtshcua.ground.language.table import END, ParserTable, Production, table

#: makes the value of a rule from the stack of values, the index of its first value, and its start and end offsets
Make = Callable[[list[Any], int, int, int], object]


class Reduction(NamedTuple):
    """A reduction: pop `length` values, push the value of `make`, and continue with `origin`."""

    origin: str
    length: int
    make: Make


def reduction(rule: Production, reader: Reader) -> Reduction:
    """Return the reduction of `rule`: by its action, or by the values that it keeps."""
    if rule.action:
        make = _call(rule.kept, reader, ACTIONS[rule.action])
    elif rule.repeats:
        make = _repeat(*(at for at in rule.kept if at is not None))
    else:
        (at,) = rule.kept
        make = _keep(at or 0)
    return Reduction(rule.origin, rule.length, make)


class Reductions(dict[int, Reduction]):
    """The reductions by the rule's number, made on demand: a short text needs few."""

    def __init__(self, rules: Sequence[Production], reader: Reader) -> None:
        super().__init__()
        self._rules, self._reader = rules, reader

    def __missing__(self, number: int) -> Reduction:
        made = self[number] = reduction(self._rules[number], self._reader)
        return made


def _keep(at: int) -> Make:
    def make(values: list[Any], base: int, start: int, end: int) -> object:
        return values[base + at]

    return make


def _repeat(first: int, *more: int) -> Make:
    """Append to the list `first`, or start a list with it; a long list is not copied at every step."""

    def make(values: list[Any], base: int, start: int, end: int) -> object:
        made = [values[base + first]] if first >= 0 else values[base + ~first]
        made.extend([values[base + at] for at in more])
        return made

    return make


def _call(kept: tuple[int | None, ...], reader: Reader, action: Action) -> Make:
    file, act = reader.source.file, MethodType(action, reader)

    def make(values: list[Any], base: int, start: int, end: int) -> object:
        arguments = [None if at is None else values[base + at] for at in kept]
        return act(Span(file, start, end), *arguments)

    def make_spreading(values: list[Any], base: int, start: int, end: int) -> object:
        arguments: list[Any] = []
        for at in kept:
            if at is None:
                arguments.append(None)
            elif at >= 0:
                arguments.append(values[base + at])
            else:
                arguments += values[base + ~at]
        return act(Span(file, start, end), *arguments)

    return make_spreading if any(at is not None and at < 0 for at in kept) else make


class Failure(NamedTuple):
    """The token at `[start, end)` does not fit. `kind` is its kind, empty if no token starts at this character."""

    start: int
    end: int
    kind: str


@dataclass(slots=True)
class Automaton:
    """The parser and its stacks: `values` and `starts` (offsets) have one entry for each state above the first.

    It calls the action of a rule with the reader, the rule's span and the kept values.
    """

    reader: Reader
    table: ParserTable = field(default_factory=table)
    states: list[int] = field(default_factory=lambda: [0])
    values: list[Any] = field(default_factory=list)
    starts: list[int] = field(default_factory=list)
    end: int = 0  # of the last shifted token, once the parser has stopped
    source: Source = field(init=False)
    rules: Reductions = field(init=False)

    def __post_init__(self) -> None:
        """Bind each rule to its action, once for the text."""
        self.source = self.reader.source
        self.rules = Reductions(self.table.rules, self.reader)

    def run(self, offset: int) -> Failure | None:
        """Parse from `offset` on. Return the failure that stops the parser, or None at the end of the text."""
        rows, lexers, last = self.table.rows, self.table.lexers, self.table.end
        rules, states, values, starts = self.rules, self.states, self.values, self.starts
        text, skipped = self.source.text, self.table.skipped
        end = offset  # of the last token that was shifted
        while True:
            match, kinds = lexers[states[-1]]
            token = match(text, end)
            if token is None and (start := skipped(text, end)) < len(text):
                token = match(text, start)
            if token:
                group = token.lastindex or 0
                word, kind = token[group], kinds[group]
                start, after = token.span(group)
            else:
                after = start
                word = kind = END
                if start < len(text):
                    self.end = end
                    return self._failure(start)
            while True:
                row = rows[states[-1]]
                step = row.get(word)  # a keyword or mark that fits here
                if step is None:
                    step = row.get(kind)
                    if step is None:
                        self.end = end
                        return Failure(start, after, kind or word)
                if step >= 0:
                    states.append(step)
                    values.append(word)
                    starts.append(start)
                    end = after
                    break
                origin, length, make = rules[~step]
                base = len(values) - length
                if length:
                    value = make(values, base, starts[base], end)
                    del states[-length:], values[base:], starts[base + 1 :]
                else:
                    value = make(values, base, end, end)
                    starts.append(end)
                state = rows[states[-1]][origin]
                states.append(state)
                values.append(value)
                if word is END and state == last:
                    return None

    def _failure(self, start: int) -> Failure:
        """The failure at `start`, where no fitting token starts; another kind of token may start there."""
        lexer = self.table.lexers.any
        token = lexer.match(self.source.text, start)
        if token and token.start(token.lastindex or 0) == start:
            group = token.lastindex or 0
            return Failure(start, token.end(), lexer.kinds[group] or token[group])
        return Failure(start, start + 1, "")
