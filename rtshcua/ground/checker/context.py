"""What every check is given: the program's names, the dialect, and where to report."""

from dataclasses import dataclass, field

from rtshcua.ground.checker.dialect import Dialect
from rtshcua.ground.checker.report import Report
from rtshcua.ground.checker.scope import Argument, Scope, parameter_type
from rtshcua.ground.checker.symbols import Symbols
from rtshcua.ground.checker.values import typed_range
from rtshcua.model.ir.expression import Coordinates
from rtshcua.model.ir.places import ZoneDecl
from rtshcua.model.ir.skills import SkillDecl

#: what an argument is bound to: a canonical integer (a choice's ordinal too), a zone, or a place
Bound = int | ZoneDecl | Coordinates


@dataclass(slots=True)
class Context:
    """One compilation's checks; `bound` keeps what arguments were resolved to, for the lowering."""

    symbols: Symbols
    report: Report
    dialect: Dialect
    bound: dict[int, tuple[Bound, ...]] = field(default_factory=dict)
    _arguments: dict[int, dict[str, Argument]] = field(default_factory=dict)

    def scope(self) -> Scope:
        """Signals and zones, and no argument."""
        return Scope(self.symbols, self.report)

    def arguments(self, skill: SkillDecl) -> dict[str, Argument]:
        """The parameters of a skill that have a type, by name."""
        found = self._arguments.get(id(skill))
        if found is None:
            found = self._arguments[id(skill)] = {}
            unheard = Scope(self.symbols, Report(self.report.sources))  # the declaration itself is checked elsewhere
            for parameter in skill.parameters:
                type = parameter_type(parameter)
                if type is not None:
                    ends = None if parameter.range is None else typed_range(unheard, parameter.range, type)
                    low, high = (None, None) if ends is None else (ends[0].constant, ends[1].constant)
                    found.setdefault(parameter.name.text, Argument(parameter, type, low, high))
        return found

    def scope_of(self, skill: SkillDecl) -> Scope:
        """What the clauses of a skill may name."""
        return Scope(self.symbols, self.report, self.arguments(skill))
