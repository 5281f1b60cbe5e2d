"""Run all lint rules over one program."""

from collections.abc import Callable, Collection, Iterator

from rtshcua.diagnostics.diagnostic import Diagnostic, has_errors
from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.load import Program
from rtshcua.ground.lint.broad_permits import broad_permits, unbounded_places
from rtshcua.ground.lint.idle_policies import idle_airspaces, policies_that_permit_all
from rtshcua.ground.lint.lint_input import LintInput
from rtshcua.ground.lint.readability import misnamed_declarations, repeated_numbers
from rtshcua.ground.lint.takeoff_landing import degrades_that_keep_up, rules_that_keep_grounded
from rtshcua.ground.lint.unused import untaken_pictures, unused_declarations, unused_imports
from rtshcua.ground.prove.proof_context import ProofContext

RULES: tuple[Callable[[LintInput], Iterator[Diagnostic]], ...] = (
    unused_declarations, misnamed_declarations, broad_permits, repeated_numbers, unused_imports,
    policies_that_permit_all, idle_airspaces, unbounded_places, degrades_that_keep_up, rules_that_keep_grounded,
    untaken_pictures,
)  # fmt: skip


def lint(
    program: Program, requested: Collection[str] | None = None, grounds: tuple[ProofContext, ...] = ()
) -> tuple[Diagnostic, ...]:
    """Return the lint findings in the `requested` files (None: the first file), in order of position.

    `grounds` are the lowered policies of the program. Without them, rules about the decisions of a policy do not run.
    A program with errors has no lint findings: the part with the error may use the other declarations.
    """
    if has_errors(program.diagnostics) or not program.units:
        return ()
    subject = LintInput.of(program, {program.units[0].file} if requested is None else requested, grounds)
    return tuple(sorted(dict.fromkeys(found for rule in RULES for found in rule(subject)), key=_place))


def _place(found: Diagnostic) -> Span:
    assert found.span is not None
    return found.span
