"""Every name of the shipped sources and samples: a renaming is refused with a reason, or no meaning changes."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import msgspec
import pytest

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.span import Span
from rtshcua.ground.editor.incremental_parse import ParsedText
from rtshcua.ground.editor.rename import RENAMED, rename
from rtshcua.ground.editor.workspace import ProgramView, Workspace
from rtshcua.ground.language.load import Program
from rtshcua.ground.language.paths import shown
from rtshcua.ground.pipeline.program import examine_program
from rtshcua.ground.pipeline.suite import suite
from rtshcua.ground.testing.case_result import run_case
from rtshcua.library import root
from rtshcua.mavlink import dialect

DIALECT = dialect.load()
CHECKOUT = Path(__file__).resolve().parents[4]
SAMPLES = CHECKOUT / "tests" / "accepted"
SHIPPED = tuple(
    shown(str(each)) for folder in ("skills", "policies", "missions", "examples/starter")
    for each in sorted((CHECKOUT / folder).glob("*.rts"))
)  # fmt: skip
#: the number of names that `make test` tries, of the shipped sources and of the samples
TRIED = 2, 4
SEED = 20261122
#: fields of the flat form with the place and text of the source
TOLD = {"text", "start", "end", "source_digests"}
NEW = "_zz"  # no existing name ends with it
_PARSED: dict[str, ParsedText] = {}


class Named(NamedTuple):
    """A name, its declaration, and the files whose programs are compared."""

    files: tuple[str, ...]
    span: Span


class Told(NamedTuple):
    """The results of a program: findings by code and line, policies, decisions."""

    found: list[tuple[str, str | None, int]]
    policies: list[Any]
    decided: Sequence[tuple[object, ...]]


class _Anyones(Workspace):
    """A workspace in which the shipped sources may be changed."""

    def is_shipped(self, name: str) -> bool:
        return False

    def with_texts(self, texts: Mapping[str, str]) -> Workspace:
        other = super().with_texts(texts)
        other.__class__ = _Anyones
        return other


def _read(path: str) -> bytes:
    return Path(path).read_bytes()


def _desk() -> Workspace:
    desk = _Anyones(_read, str(root()), lambda folder: [each.name for each in Path(folder).iterdir()])
    desk._files = _PARSED
    return desk


def _names(desk: Workspace, file: str, files: tuple[str, ...]) -> Iterator[Named]:
    for each in desk.view(file).occurrences(file):
        if each.declares and each.target.kind in RENAMED:
            yield Named(files, each.span)


def told(view: ProgramView) -> Told:
    program = view.program
    checked = examine_program(program, DIALECT)
    found = [
        (each.code.id, None if each.span is None else each.span.file, _line(program, each.span))
        for each in checked.diagnostics
    ]
    ran = [run_case(case) for case in suite(program, DIALECT).cases]
    policies = [_plain(each.policy) for each in checked.policies]
    decided = [(each.met, each.trace.decision.outcome, each.trace.decision.reason) for each in ran]
    return Told(sorted(found, key=str), policies, decided)


def _line(program: Program, span: Span | None) -> int:
    return 0 if span is None else program.sources[span.file].text.count("\n", 0, span.start)


def _plain(flat: Any) -> Any:
    if isinstance(flat, msgspec.Struct):
        return {each: _plain(getattr(flat, each)) for each in flat.__struct_fields__ if each not in TOLD}
    if isinstance(flat, tuple):
        return [_plain(each) for each in flat]
    return flat.replace(NEW, "") if isinstance(flat, str) else flat


def hold(desk: Workspace, before: dict[str, Told], named: Named, chance: Random, most: int) -> bool:
    """Renames, looks at `most` of the programs that change, and renames back; whether it could be renamed.

    `before` keeps what programs come to.
    """
    file, start, _ = named.span
    view = desk.view(file)
    old = view.slice(named.span)
    made = rename(desk, named.files, view, file, start, old + NEW, DIALECT)
    if isinstance(made, Refusal):
        assert made.text
        return False
    changed = desk.with_texts({each: made.applied(each, desk.text(each) or "") for each in made.places})
    programs = [each for each in named.files if made.places.keys() & desk.view(each).units.keys()]
    for name in chance.sample(programs, min(most, len(programs))):
        if name not in before:
            before[name] = told(desk.view(name))
        assert told(changed.view(name)) == before[name], (old, name)
    moved = sum(len(NEW) for span in made.places[file] if span.start < start)
    back = rename(changed, named.files, changed.view(file), file, start + moved, old, DIALECT)
    assert not isinstance(back, Refusal), (old, back.text)
    assert all(back.applied(each, changed.text(each) or "") == desk.text(each) for each in made.places)
    return True


def every() -> tuple[list[Named], list[Named]]:
    """The names of the shipped sources and of the samples, each of which is a program."""
    desk = _desk()
    shipped = [each for file in SHIPPED for each in _names(desk, file, SHIPPED)]
    samples = [
        each
        for file in sorted(shown(str(each)) for each in SAMPLES.glob("*.rts"))
        for each in _names(desk, file, (file,))
    ]
    return shipped, samples


@pytest.mark.slow
@pytest.mark.parametrize("kind", [0, 1], ids=["shipped", "samples"])
def test_renaming_some_names_changes_no_meaning(kind: int) -> None:
    chance = Random(SEED)
    desk, before = _desk(), dict[str, Told]()
    tried = chance.sample(every()[kind], TRIED[kind])
    renamed = [hold(desk, before, each, chance, 1) for each in tried]
    assert any(renamed)


@pytest.mark.soak
@pytest.mark.parametrize("kind", [0, 1], ids=["shipped", "samples"])
def test_renaming_every_name_changes_no_meaning(kind: int) -> None:
    desk, before = _desk(), dict[str, Told]()
    renamed = [hold(desk, before, each, Random(SEED), 100) for each in every()[kind]]
    assert any(renamed)
