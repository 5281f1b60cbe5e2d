"""All rules over one program."""

from collections.abc import Collection, Iterable

from rtshcua.diagnostics.diagnostic import Diagnostic, has_errors
from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.load import Program
from rtshcua.ground.lint import airspace, authority, gating, grounded, imports, landing, naming, numbers, places, unused
from rtshcua.ground.lint.subject import Subject
from rtshcua.ground.prove.proof_context import ProofContext

RULES = (unused, naming, authority, numbers, imports, gating, airspace, places, landing, grounded)


def lint(
    program: Program, asked: Collection[str] | None = None, grounds: tuple[ProofContext, ...] = ()
) -> tuple[Diagnostic, ...]:
    """What is worth a second look in the files `asked` for (None: the first), by place. `grounds` are the lowered
    policies of the program, if it was compiled; without them, the rules about what a policy decides say nothing.

    Nothing of a program that could not be read without errors, for what has an error may be what uses the rest.
    """
    if has_errors(program.diagnostics) or not program.units:
        return ()
    subject = Subject.of(program, {program.units[0].file} if asked is None else asked, grounds)
    return _by_place(found for rule in RULES for found in rule.check(subject))


def _by_place(found: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    return tuple(sorted(dict.fromkeys(found), key=_place))


def _place(found: Diagnostic) -> Span:
    assert found.span is not None
    return found.span
