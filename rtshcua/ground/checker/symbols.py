"""The symbol table of a program, in which a name has one meaning, and labels for the uses of a template."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import NamedTuple

from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.diagnostics.span import Span
from rtshcua.diagnostics.suggest import nearest
from rtshcua.ground.checker.report import Report
from rtshcua.ground.checker.substitution import sized
from rtshcua.model.ir.missions import MissionDecl
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.places import VehicleDecl, ZoneDecl
from rtshcua.model.ir.policies import PolicyDecl, RuleDecl, TemplateDecl, Use
from rtshcua.model.ir.program import Unit
from rtshcua.model.ir.scenarios import ScenarioDecl
from rtshcua.model.ir.signals import EnumDecl, SignalDecl
from rtshcua.model.ir.skills import SizesDecl, SkillDecl
from rtshcua.model.ir.tests import NominalDecl, TestDecl

Declaration = (
    EnumDecl | SignalDecl | ZoneDecl | VehicleDecl | SkillDecl | TemplateDecl | PolicyDecl | MissionDecl | NominalDecl
)


class Extent(NamedTuple):
    """The range from the lowest to the highest value, in canonical units; None for no bound."""

    low: Fraction | int | None
    high: Fraction | int | None

    def has(self, value: Fraction | int) -> bool:
        """Whether a value is in the range."""
        return (self.low is None or self.low <= value) and (self.high is None or value <= self.high)


#: a fix as `Report.add` takes it: the span, the replacement and a title
Correction = tuple[Span, str, str]

#: the kinds of declarations in messages
WORDS: Mapping[type, str] = {
    EnumDecl: "an enumeration",
    SignalDecl: "a signal",
    ZoneDecl: "a zone",
    VehicleDecl: "a vehicle",
    SkillDecl: "a skill",
    TemplateDecl: "a template",
    PolicyDecl: "a policy",
    MissionDecl: "a mission",
    NominalDecl: "a nominal",
}


@dataclass(slots=True)
class Symbols:
    """The declarations of a program by name, in one name space for all kinds, and again by kind.

    Roles have a name space of their own, and several files may declare the same role.

    `tests` and `scenarios` are those of the compiled file; they have quoted names. `broken` has the names of
    declarations with a syntax error, which are never reported. `skills` have the values of their sizes substituted;
    `sizes` has the declarations of these values by skill. `ranges` has the range of each valid numeric signal.
    """

    declared: dict[str, Declaration] = field(default_factory=dict)
    duplicates: list[tuple[Declaration, Declaration]] = field(default_factory=list)
    enums: dict[str, EnumDecl] = field(default_factory=dict)
    signals: dict[str, SignalDecl] = field(default_factory=dict)
    zones: dict[str, ZoneDecl] = field(default_factory=dict)
    vehicles: dict[str, VehicleDecl] = field(default_factory=dict)
    skills: dict[str, SkillDecl] = field(default_factory=dict)
    templates: dict[str, TemplateDecl] = field(default_factory=dict)
    policies: dict[str, PolicyDecl] = field(default_factory=dict)
    missions: dict[str, MissionDecl] = field(default_factory=dict)
    nominals: dict[str, NominalDecl] = field(default_factory=dict)
    roles: dict[str, Name] = field(default_factory=dict)
    roles_again: list[tuple[Name, Name]] = field(default_factory=list)
    sizes: dict[str, SizesDecl] = field(default_factory=dict)
    sizes_again: list[tuple[SizesDecl, SizesDecl]] = field(default_factory=list)
    tests: tuple[TestDecl, ...] = ()
    scenarios: tuple[ScenarioDecl, ...] = ()
    broken: frozenset[str] = frozenset()
    ranges: dict[str, Extent] = field(default_factory=dict)

    def _declare(self, declarations: Sequence[Declaration], table: dict[str, Declaration]) -> None:
        for declaration in declarations:
            name = declaration.name.text
            first = self.declared.setdefault(name, declaration)
            if first is declaration:
                table[name] = declaration
            else:
                self.duplicates.append((first, declaration))

    def kind_of(self, name: str) -> str | None:
        """The kind of the declaration of `name` for a message, or None."""
        declaration = self.declared.get(name)
        return None if declaration is None else WORDS[type(declaration)]


def collect(units: Iterable[Unit], broken: frozenset[str] = frozenset()) -> Symbols:
    """Return the symbol table of a program.

    Of two declarations of one name, or two `sizes` of one skill, the first counts and the second is a duplicate. Units
    are in the order in which files were reached, the compiled files first.
    """
    symbols = Symbols(broken=broken)
    for number, unit in enumerate(units):
        if not number:
            symbols.tests, symbols.scenarios = unit.tests, unit.scenarios
        for declarations, table in (
            (unit.enums, symbols.enums),
            (unit.signals, symbols.signals),
            (unit.zones, symbols.zones),
            (unit.vehicles, symbols.vehicles),
            (unit.skills, symbols.skills),
            (unit.templates, symbols.templates),
            (unit.policies, symbols.policies),
            (unit.missions, symbols.missions),
            (unit.nominals, symbols.nominals),
        ):
            symbols._declare(declarations, table)  # type: ignore[arg-type]
        for role in (name for declaration in unit.roles for name in declaration.names):
            first = symbols.roles.setdefault(role.text, role)
            if first is not role and first.span.file == role.span.file:
                symbols.roles_again.append((first, role))
        for sizes in unit.sizes:
            former = symbols.sizes.setdefault(sizes.skill.text, sizes)
            if former is not sizes:
                symbols.sizes_again.append((former, sizes))
    for name, skill in symbols.skills.items():
        symbols.declared[name] = symbols.skills[name] = sized(skill, symbols.sizes.get(name))
    return symbols


def suggestion(word: str, known: Iterable[str], about: str = "") -> str | None:
    """Return `did you mean ...?` for an unknown word; `about` is the surrounding text."""
    near = nearest(word, known, about)
    return None if near is None else f"did you mean `{near}`?"


def correction(report: Report, span: Span, word: str, known: Iterable[str], about: str = "") -> Correction | None:
    """Return the suggestion as a fix of the text under a span.

    None without a suggestion, or if the text is not the word itself, bare or in quotes, as after a substitution.
    """
    near = nearest(word, known, about)
    written = report.raw(span)
    if near is None or written not in (word, f'"{word}"'):
        return None
    return span, written.replace(word, near), f"write `{near}`"


USED = "used here"
DELEGATED = "delegated here"

#: the most uses that a finding on a template names
MAX_USES = 3


def brought_about(rule: RuleDecl) -> Iterator[tuple[Span, str]]:
    """Return labels for the `use` and the delegations from which a rule was made."""
    for node in rule.origin:
        yield node.span, USED if isinstance(node, Use) else DELEGATED


def with_uses(found: Diagnostic, symbols: Symbols) -> Diagnostic:
    """Return the finding; inside a template with labels for its uses, unless it has them."""
    span = found.span
    template = None if span is None else _around(span, symbols.templates.values())
    if template is None or any(label.text == USED for label in found.labels):
        return found
    uses = [use for policy in symbols.policies.values() for use in policy.uses]
    own = [use for use in uses if use.template.text == template.name.text]
    return replace(found, labels=(*found.labels, *(Label(use.span, USED) for use in own[:MAX_USES])))


def _around(span: Span, templates: Iterable[TemplateDecl]) -> TemplateDecl | None:
    for each in templates:
        if span.file == each.span.file and each.span.start <= span.start and span.end <= each.span.end:
            return each
    return None
