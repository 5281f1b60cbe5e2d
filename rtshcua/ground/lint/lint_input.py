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
    """A program as it is written, and which of its sources were asked for; `grounds` are its policies as lowered, each
    for a vehicle, with which the analysis can be asked.

    A mission specification is none of them: it is no source, and an agent writes it by another form.
    """

    program: Program
    symbols: Symbols
    asked: tuple[Unit, ...]
    imports: Imports
    grounds: tuple[ProofContext, ...] = ()

    @staticmethod
    def of(program: Program, asked: Collection[str], grounds: tuple[ProofContext, ...] = ()) -> "LintInput":
        """A program without errors."""
        units = tuple(unit for unit in program.units if unit.file in asked and PurePath(unit.file).suffix != ".json")
        return LintInput(program, collect(program.units), units, Imports(program.units, program.stable), grounds)

    def lowered(self) -> Iterator[ProofContext]:
        """The lowered policies of the files that were asked for."""
        asked = {unit.file for unit in self.asked}
        return (ground for ground in self.grounds if ground.lowered.declaration.span.file in asked)

    def rules(self) -> tuple[RuleDecl | Delegation, ...]:
        """Every rule and delegation of the program, those of templates once, as they are written."""
        policies = tuple(self.symbols.policies.values())
        owners: list[PolicyDecl | TemplateDecl] = [*policies, *self.symbols.templates.values()]
        found: list[RuleDecl | Delegation] = [rule for owner in owners for rule in owner.rules]
        return (*found, *(each for policy in policies for each in policy.delegations))

    def permits_any(self) -> bool:
        """Whether a rule permits every skill that there is."""
        return any(isinstance(rule, RuleDecl) and rule.kind == "permit" and not rule.skills for rule in self.rules())


def rules_of(unit: Unit) -> list[RuleDecl]:
    """The rules of a file's policies and templates."""
    owners: list[PolicyDecl | TemplateDecl] = [*unit.policies, *unit.templates]
    return [rule for owner in owners for rule in owner.rules]
