"""What each name of a program stands for: one name, one meaning. Findings inside of a template say where it is used."""

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
    """From the least to the greatest value, in canonical units; None where there is no bound."""

    low: Fraction | int | None
    high: Fraction | int | None

    def has(self, value: Fraction | int) -> bool:
        """Whether a value is within."""
        return (self.low is None or self.low <= value) and (self.high is None or value <= self.high)


#: a fix as `Report.add` takes it: the span, the replacement and a title
Correction = tuple[Span, str, str]

#: how a kind of declaration is called in a message
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
    """The declarations of a program by name, all kinds in one name space, and once more by kind. Roles have a
    name space of their own, and may be declared by several files.

    `tests` and `scenarios` are those of the file that was asked for, which has them run; they are called by texts, not
    by names.
    `broken` are the names whose declarations have a syntax error: nothing is known of them, and nothing is said.
    `skills` have the values of their sizes in the places of these; `sizes` is what the program says of them, by skill.
    `ranges` has, of each signal of a number that was found well declared, what it can report.
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
        """What `name` stands for, in words, or None."""
        declaration = self.declared.get(name)
        return None if declaration is None else WORDS[type(declaration)]


def collect(units: Iterable[Unit], broken: frozenset[str] = frozenset()) -> Symbols:
    """The symbol table of a program; of two declarations of one name, or of the sizes of one skill, the first counts,
    the second is a duplicate.

    Units come in the order in which files are reached, those that were asked for first.
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
    """`did you mean ...?` for a word that is not among the known ones; `about` are words that stand around it."""
    near = nearest(word, known, about)
    return None if near is None else f"did you mean `{near}`?"


def correction(report: Report, span: Span, word: str, known: Iterable[str], about: str = "") -> Correction | None:
    """What `suggestion` says as a fix of the text under a span: None where it says nothing, or where the text is not
    the word itself, bare or in quotation marks, but was brought about elsewhere.
    """
    near = nearest(word, known, about)
    written = report.raw(span)
    if near is None or written not in (word, f'"{word}"'):
        return None
    return span, written.replace(word, near), f"write `{near}`"


USED = "used here"
DELEGATED = "delegated here"

#: of how many uses a finding tells that is about all of them
MAX_USES = 3


def brought_about(rule: RuleDecl) -> Iterator[tuple[Span, str]]:
    """Labels for the `use` and the delegations through which a rule came to be."""
    for node in rule.origin:
        yield node.span, USED if isinstance(node, Use) else DELEGATED


def with_uses(found: Diagnostic, symbols: Symbols) -> Diagnostic:
    """The finding; inside of a template, and where nothing says so yet, with the places where the template is used."""
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
