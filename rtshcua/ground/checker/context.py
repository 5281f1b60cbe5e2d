"""The context of all checks: the program's names, the dialect, and the report."""

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

#: declarations with parameters
Parametric = SkillDecl | TemplateDecl | MissionDecl

#: the value of an argument: a canonical integer (for a choice its ordinal), a zone, or coordinates
Bound = int | ZoneDecl | Coordinates

#: nodes that call a skill with arguments
Call = Step | LinkDecl


class Instance(NamedTuple):
    """A mission with values for its parameters, and labels with these values."""

    mission: MissionDecl
    labels: tuple[tuple[Span, str], ...]


@dataclass(slots=True)
class CheckContext:
    """The context of one compilation's checks.

    `bind` and `bound` keep the bound arguments of a call by its skill and the written arguments with their spans.
    `given` has the values of signals in premises, by the signal's name and the written value. `instances` has the
    checked instances of each mission with parameters. `samples` has the rules of unused templates, with sample values.
    `data` has the zone files.
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
        """The scope of signals and zones, without arguments."""
        if self._plain is None:
            self._plain = Scope(self.symbols, self.report)
        return self._plain

    def bind(self, call: Call, arguments: tuple[Bound, ...]) -> None:
        """Keep the bound arguments of a call, one for each parameter of its skill, for the lowering."""
        self._bound[call.skill.text, call.arguments] = arguments

    def bound(self, call: Call) -> tuple[Bound, ...]:
        """Return the bound arguments of a checked call without findings."""
        return self._bound[call.skill.text, call.arguments]

    def arguments(self, skill: Parametric) -> dict[str, Argument]:
        """Return the parameters of a skill, a template or a mission with a valid type, by name."""
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
        """Every mission; one with parameters is repeated for each set of values, which findings name."""
        for name, mission in self.symbols.missions.items():
            instances = self.instances.get(name, (Instance(mission, ()),))
            for instance in instances:
                with self.report.within(instance.labels, len(instances)):
                    yield instance.mission

    def scope_of(self, skill: SkillDecl) -> Scope:
        """The scope of a skill's clauses."""
        return Scope(self.symbols, self.report, self.arguments(skill))
