"""What every check is given: the program's names, the dialect, and where to report."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.geojson import DataFiles
from rtshcua.ground.checker.name_scope import Argument, Scope, parameter_type
from rtshcua.ground.checker.report import Report
from rtshcua.ground.checker.symbols import Symbols
from rtshcua.ground.checker.values import whole_range
from rtshcua.mavlink.dialect import Dialect
from rtshcua.model.ir.expression import Coordinates, Value
from rtshcua.model.ir.missions import MissionDecl, Step
from rtshcua.model.ir.places import ZoneDecl
from rtshcua.model.ir.policies import RuleDecl, TemplateDecl
from rtshcua.model.ir.skills import ArgumentValue, LinkDecl, SkillDecl

#: what has parameters
Parametric = SkillDecl | TemplateDecl | MissionDecl

#: what an argument is bound to: a canonical integer (a choice's ordinal too), a zone, or a place
Bound = int | ZoneDecl | Coordinates

#: what calls a skill with arguments
Call = Step | LinkDecl


class Instance(NamedTuple):
    """A mission with values for its parameters, and labels that say which."""

    mission: MissionDecl
    labels: tuple[tuple[Span, str], ...]


@dataclass(slots=True)
class CheckContext:
    """One compilation's checks.

    What the arguments of a call were bound to is kept by its skill and the arguments as written, the place included
    (`bind`, `bound`); `given` has the values that premises give to signals, by the signal's name and the value as
    written. `instances` has, of each mission with parameters, those that are checked; `samples` the rules of templates
    that no policy uses, with values that their parameters might have. `data` are the files that zones are read from.
    """

    symbols: Symbols
    report: Report
    dialect: Dialect
    given: dict[tuple[str, Value], Bound] = field(default_factory=dict)
    instances: dict[str, tuple[Instance, ...]] = field(default_factory=dict)
    samples: tuple[RuleDecl, ...] = ()
    data: DataFiles = field(default_factory=DataFiles)
    _bound: dict[tuple[str, tuple[ArgumentValue, ...]], tuple[Bound, ...]] = field(default_factory=dict)
    _arguments: dict[Span, dict[str, Argument]] = field(default_factory=dict)
    _plain: Scope | None = None

    def scope(self) -> Scope:
        """Signals and zones, and no argument."""
        if self._plain is None:
            self._plain = Scope(self.symbols, self.report)
        return self._plain

    def bind(self, call: Call, arguments: tuple[Bound, ...]) -> None:
        """Keep what the arguments of a call mean, one for each parameter of its skill, for the lowering."""
        self._bound[call.skill.text, call.arguments] = arguments

    def bound(self, call: Call) -> tuple[Bound, ...]:
        """What the arguments of a call mean that was checked and in which nothing was found."""
        return self._bound[call.skill.text, call.arguments]

    def arguments(self, skill: Parametric) -> dict[str, Argument]:
        """The parameters of a skill, a template or a mission that have a type, by name."""
        found = self._arguments.get(skill.name.span)  # each declaration's name stands in a place of its own
        if found is None:
            found = self._arguments[skill.name.span] = {}
            unheard = Scope(self.symbols, Report(self.report.sources))  # the declaration itself is checked elsewhere
            for parameter in skill.parameters:
                type = parameter_type(parameter)
                if type is not None:
                    ends = None if parameter.range is None else whole_range(unheard, parameter.range, type)
                    low, high = (None, None) if ends is None else ends
                    found.setdefault(parameter.name.text, Argument(parameter, type, low, high))
        return found

    def missions(self) -> Iterator[MissionDecl]:
        """Every mission; one with parameters, for each of the values that it is checked with, which findings tell."""
        for name, mission in self.symbols.missions.items():
            instances = self.instances.get(name, (Instance(mission, ()),))
            for instance in instances:
                with self.report.within(instance.labels, len(instances)):
                    yield instance.mission

    def scope_of(self, skill: SkillDecl) -> Scope:
        """What the clauses of a skill may name."""
        return Scope(self.symbols, self.report, self.arguments(skill))
