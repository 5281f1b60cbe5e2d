"""Source text through the linter: findings, ignores by a naive reading of comments, and harmless fixes."""

from collections.abc import Iterable
from random import Random

from fuzz import corpus, world
from fuzz.mutation import sentences
from reference import ignoring
from rtshcua.app.lint.findings import LintFindings
from rtshcua.app.lint.fix import fix
from rtshcua.diagnostics.codes import can_be_ignored
from rtshcua.diagnostics.diagnostic import has_errors
from rtshcua.diagnostics.span import Source
from rtshcua.ground.language.load import load
from rtshcua.ground.language.parse import parse
from rtshcua.ground.lint.filter import filter_findings
from rtshcua.ground.lint.fixes import chosen
from rtshcua.ground.lint.ignores import comments
from rtshcua.ground.lint.linter import lint
from rtshcua.ground.pipeline.program import examine_program
from rtshcua.mavlink import dialect
from rtshcua.model.ir.node import Node

MAX_LENGTH = 8_000

_CODES = (
    "E1301",
    "unused",
    "E1302",
    "naming",
    "E1303",
    "E1304",
    "unused-import",
    "E1305",
    "E0720",
    "E0101",
    "E1309",
    "E13",
)
_REASONS = (" because it is known", " because", "", " because the register says so", " becuase of it")
_WORDS = ("ignore", "ignore", "ignore-file", "ignore-file", "ignor")
_IMPORTS = ("skills/goto", "skills/hover", "policies/site", "skills/signals", "policies/training_field")


def seeds() -> Iterable[bytes]:
    """All texts; those with lint findings several times."""
    habits = [path.read_bytes() for path in sorted((corpus.TESTS / "rejected").glob("e13*.rts"))]
    return (*corpus.sources(), *habits * 6)


def mutated(data: bytes, of: Random) -> bytes:
    """A changed text, often with an ignore, an unused import or a name in another style."""
    choice = of.random()
    if choice < 0.4:
        return sentences.mutated(data, of)
    lines = data.decode("utf-8", errors="replace").split("\n")
    at = of.randrange(len(lines))
    if choice < 0.85:
        names = of.choice((", ", " ", ",")).join(of.choices(_CODES, k=of.choice((1, 1, 1, 2, 3))))
        marks = of.choice((("// ", ""), ("//", ""), ("/* ", " */")))
        comment = f"{marks[0]}rtshcua: {of.choice(_WORDS)} {names}{of.choice(_REASONS)}{marks[1]}"
        where = of.random()
        if where < 0.4:
            lines[at] += f" {comment}"
        else:
            lines.insert(at if where < 0.7 else 0, comment)
    elif choice < 0.93:
        lines.insert(0, f'import "lib:{of.choice(_IMPORTS)}.rts"{of.choice(("", " // for later", " /* why */"))}')
    else:
        words = lines[at].split(" ")
        which = of.randrange(len(words))
        words[which] = words[which].title()
        lines[at] = " ".join(words)
    return "\n".join(lines).encode()


class Held:
    """One text, with the file operations of `fix`."""

    def __init__(self, data: bytes) -> None:
        self.data = data

    def read(self, _name: str) -> bytes:
        return self.data

    def put(self, _name: str, data: bytes) -> None:
        self.data = data

    def examined(self) -> LintFindings:
        """All findings in the text."""
        program = load([world.PROBE], world.reading({world.PROBE: self.data}), world.LIBRARY, world.listing)
        checked = examine_program(program, dialect.load())
        found = checked.diagnostics
        if not has_errors(found):
            found += lint(program, None, checked.grounds)
        untold = [world.PROBE] if has_errors(found) else []
        sifted = filter_findings(found, program.sources, [world.PROBE], {}, untold)
        source = program.sources.get(world.PROBE)
        if source is not None:
            expected = ignoring.ignored(source, found)
            assert {each.diagnostic for each in sifted.ignored} == expected, (sifted.ignored, expected)
        world.hold(sifted.found, program.sources)
        return LintFindings(sifted.found, sifted.ignored, program.sources, sifted.used, frozenset(untold))


def one(data: bytes) -> None:
    held = Held(data)
    told = held.examined()
    if world.PROBE not in told.sources:
        return
    for text in _ignoring(told):
        Held(text).examined()
    done = fix(held, told, held.examined, [world.PROBE], suggested=False)  # type: ignore[arg-type]
    if not done.refused and _is_text(data):
        left = [
            each for each in done.told.found if (it := chosen(each, suggested=False)) and it.span.file == world.PROBE
        ]
        assert not left, left
    if held.data != data:
        _same(Source("x", data.decode("utf-8-sig")), Source("x", held.data.decode("utf-8-sig")))
    assert not has_errors(done.told.found) or has_errors(told.found)
    other = Held(data)
    done = fix(other, told, other.examined, [world.PROBE], suggested=True)  # type: ignore[arg-type]
    assert not has_errors(done.told.found) or has_errors(told.found)


def _ignoring(told: LintFindings) -> Iterable[bytes]:
    """The text with one of its findings ignored, in one of the three ways."""
    source = told.sources[world.PROBE]
    found = [each for each in told.found if each.span is not None and each.span.file == world.PROBE]
    found = [each for each in found if can_be_ignored(each.code)]
    if found:
        each = found[len(source.text) % len(found)]
        assert each.span is not None
        lines = source.text.split("\n")
        line = source.position(each.span.start).line - 1
        way = len(lines) % 3
        comment = f"// rtshcua: ignore{'-file' * (way == 2)} E1302, {each.code.slug} because it is known"
        if way == 0:
            lines[line] += f" {comment}"
        else:
            lines.insert(line if way == 1 else 0, comment)
        yield "\n".join(lines).encode()


def _is_text(data: bytes) -> bool:
    try:
        return bool(data.decode("utf-8-sig")) or True
    except UnicodeDecodeError:
        return False


def _same(before: Source, after: Source) -> None:
    """Check that safe fixes only remove imports and ignores, each with its line at most."""
    old, new = parse(before).unit, parse(after).unit
    for name in type(old).__struct_fields__:
        if name not in ("span", "imports"):
            assert _plain(getattr(old, name)) == _plain(getattr(new, name)), name
    kept = [each.inside for each in comments(after) if "rtshcua:" not in each.inside]
    lines = before.text.split("\n")
    for each in comments(before):
        line = lines[before.position(each.span.start).line - 1]
        if kept and kept[0] == each.inside:
            kept.pop(0)
        else:
            assert "rtshcua:" in each.inside or line.lstrip().startswith("import"), (each.inside, line)
    assert not kept, kept


def _plain(value: object) -> object:
    if isinstance(value, Node):
        return type(value).__name__, {
            name: _plain(getattr(value, name)) for name in type(value).__struct_fields__ if name != "span"
        }
    return [_plain(each) for each in value] if isinstance(value, tuple) else value
