"""What the rules look at."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import PurePath

from rtshcua.ground.checker.symbols import Symbols, collect
from rtshcua.ground.language.load import Program
from rtshcua.ground.pipeline.closure import Imports
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.model.ir.policies import Delegation, PolicyDecl, Rule, TemplateDecl
from rtshcua.model.ir.program import Unit


@dataclass(frozen=True, slots=True)
class Subject:
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
    def of(program: Program, asked: Collection[str], grounds: tuple[ProofContext, ...] = ()) -> "Subject":
        """A program without errors."""
        units = tuple(unit for unit in program.units if unit.file in asked and PurePath(unit.file).suffix != ".json")
        return Subject(program, collect(program.units), units, Imports(program.units, program.stable), grounds)

    def lowered(self) -> Iterator[ProofContext]:
        """The lowered policies of the files that were asked for."""
        asked = {unit.file for unit in self.asked}
        return (ground for ground in self.grounds if ground.lowered.declaration.span.file in asked)

    @property
    def policies(self) -> tuple[PolicyDecl, ...]:
        """Every policy of the program."""
        return tuple(self.symbols.policies.values())

    def rules(self) -> tuple[Rule | Delegation, ...]:
        """Every rule and delegation of the program, those of templates once, as they are written."""
        owners: list[PolicyDecl | TemplateDecl] = [*self.policies, *self.symbols.templates.values()]
        found: list[Rule | Delegation] = [rule for owner in owners for rule in owner.rules]
        return (*found, *(each for policy in self.policies for each in policy.delegations))

    def permits_any(self) -> bool:
        """Whether a rule permits every skill that there is."""
        return any(isinstance(rule, Rule) and rule.kind == "permit" and not rule.skills for rule in self.rules())
