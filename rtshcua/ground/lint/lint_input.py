"""The input of the lint rules."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import PurePath

from rtshcua.ground.checker.symbols import Symbols, collect
from rtshcua.ground.language.load import Program
from rtshcua.ground.pipeline.closure import Imports
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.model.ir.policies import Delegation, PolicyDecl, RuleDecl, TemplateDecl
from rtshcua.model.ir.program import Unit


@dataclass(frozen=True, slots=True)
class LintInput:
    """A program, its units to lint (`requested`), and its lowered policies, one for each vehicle (`grounds`).

    Mission specifications are not linted: they are written by agents, not in the language.
    """

    program: Program
    symbols: Symbols
    requested: tuple[Unit, ...]
    imports: Imports
    grounds: tuple[ProofContext, ...] = ()

    @staticmethod
    def of(program: Program, requested: Collection[str], grounds: tuple[ProofContext, ...] = ()) -> "LintInput":
        """Return the input for a program without errors and the names of the files to lint."""
        units = tuple(u for u in program.units if u.file in requested and PurePath(u.file).suffix != ".json")
        return LintInput(program, collect(program.units), units, Imports(program.units, program.stable), grounds)

    def lowered(self) -> Iterator[ProofContext]:
        """The lowered policies of the requested files."""
        requested = {unit.file for unit in self.requested}
        return (ground for ground in self.grounds if ground.lowered.declaration.span.file in requested)

    def rules(self) -> tuple[RuleDecl | Delegation, ...]:
        """Return every rule and delegation of the program as written, those of a template once."""
        policies = tuple(self.symbols.policies.values())
        owners: list[PolicyDecl | TemplateDecl] = [*policies, *self.symbols.templates.values()]
        found: list[RuleDecl | Delegation] = [rule for owner in owners for rule in owner.rules]
        return (*found, *(each for policy in policies for each in policy.delegations))

    def permits_any(self) -> bool:
        """Whether a rule permits every skill."""
        return any(isinstance(rule, RuleDecl) and rule.kind == "permit" and not rule.skills for rule in self.rules())


def rules_of(unit: Unit) -> list[RuleDecl]:
    """The rules of a file's policies and templates."""
    owners: list[PolicyDecl | TemplateDecl] = [*unit.policies, *unit.templates]
    return [rule for owner in owners for rule in owner.rules]
