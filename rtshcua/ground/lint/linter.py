"""Runs all lint rules over one program."""

from collections.abc import Callable, Collection, Iterator

from rtshcua.diagnostics.diagnostic import Diagnostic, has_errors
from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.load import Program
from rtshcua.ground.lint.broad_permits import broad_permits, unbounded_places
from rtshcua.ground.lint.idle_policies import idle_airspaces, policies_that_permit_all
from rtshcua.ground.lint.lint_input import LintInput
from rtshcua.ground.lint.readability import misnamed_declarations, repeated_numbers
from rtshcua.ground.lint.takeoff_landing import degrades_that_keep_up, rules_that_keep_grounded
from rtshcua.ground.lint.unused import unused_declarations, unused_imports
from rtshcua.ground.prove.proof_context import ProofContext

RULES: tuple[Callable[[LintInput], Iterator[Diagnostic]], ...] = (
    unused_declarations, misnamed_declarations, broad_permits, repeated_numbers, unused_imports,
    policies_that_permit_all, idle_airspaces, unbounded_places, degrades_that_keep_up, rules_that_keep_grounded,
)  # fmt: skip


def lint(
    program: Program, asked: Collection[str] | None = None, grounds: tuple[ProofContext, ...] = ()
) -> tuple[Diagnostic, ...]:
    """What is worth a second look in the files `asked` for (None: the first), by place. `grounds` are the lowered
    policies of the program, if it was compiled; without them, the rules about what a policy decides say nothing.

    Nothing of a program that could not be read without errors, for what has an error may be what uses the rest.
    """
    if has_errors(program.diagnostics) or not program.units:
        return ()
    subject = LintInput.of(program, {program.units[0].file} if asked is None else asked, grounds)
    return tuple(sorted(dict.fromkeys(found for rule in RULES for found in rule(subject)), key=_place))


def _place(found: Diagnostic) -> Span:
    assert found.span is not None
    return found.span
