"""What the report of the evaluation consists of: sections of tables and charts, the same for HTML and Markdown.

Texts name code in backticks. A table carries the choices of ours that its figures rest on.
"""

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

from rtshcua.evaluation.computer import Computer
from rtshcua.evaluation.design import MODES
from rtshcua.evaluation.headline_claims import Claims, absent_modes
from rtshcua.evaluation.measures import Averaged, FlightTable
from rtshcua.evaluation.published import CASES
from rtshcua.evaluation.results import Result
from rtshcua.ground.drawing.bar_chart import BarChart, StackedChart

ABSENT: Final = "not available here"
UNMEASURED: Final = "not measured"
#: where the paper gives no figure
NONE: Final = "-"


class ReportColumn(NamedTuple):
    """A column of a table; numbers are aligned to the right."""

    name: str
    number: bool = False


class ReportCell(NamedTuple):
    """A cell whose style says something: `held`, `missed` or `open`."""

    text: str
    kind: str


class ReportLinks(NamedTuple):
    """A cell of links."""

    addresses: tuple[str, ...]


#: the cells of a row
ReportRow = tuple[str | ReportCell | ReportLinks, ...]


class ReportTable(NamedTuple):
    """A table; the first column names its rows. `choices` are anchors of `published.CHOICES`."""

    caption: str
    columns: tuple[ReportColumn, ...]
    rows: tuple[ReportRow, ...]
    choices: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


class ReportChart(NamedTuple):
    """A chart with its caption. Its figures are also in a table."""

    chart: BarChart | StackedChart
    caption: str


class ReportSection(NamedTuple):
    """A section: its anchor, title, introduction, and its tables and charts."""

    anchor: str
    title: str
    lead: tuple[str, ...]
    parts: tuple[ReportTable | ReportChart, ...]


class EvaluationReport(NamedTuple):
    """The whole report; `verdict` is one sentence about the headline claims."""

    title: str
    made: str
    computer: Computer
    verdict: str
    claims: Claims
    sections: tuple[ReportSection, ...]


class Measured(NamedTuple):
    """The raw results, with the flights of X1 by cell and the modes that this computer does not have."""

    results: tuple[Result, ...]
    flights: FlightTable
    absent: dict[str, str]

    @classmethod
    def of(cls, results: Iterable[Result]) -> "Measured":
        """Sort the raw results."""
        kept = tuple(results)
        return cls(kept, FlightTable(kept), absent_modes(kept))

    def missing(self, mode: str) -> str:
        """Say why there is no figure of a mode."""
        return ABSENT if mode in self.absent else UNMEASURED


def columns(*names: str) -> tuple[ReportColumn, ...]:
    """Return columns; a name that begins with `#` is one of numbers."""
    return tuple(ReportColumn(name.removeprefix("#"), name.startswith("#")) for name in names)


def digits(value: float) -> str:
    """Return a number with three significant digits, and all digits from a thousand on."""
    if abs(value) >= 999.5:
        return f"{value:,.0f}"
    return f"{value:#.3g}".removesuffix(".") if value else "0"


def ms(nanoseconds: float | None) -> str:
    """Return a duration in ms."""
    return NONE if nanoseconds is None else digits(nanoseconds / 1e6)


def us(nanoseconds: float | None) -> str:
    """Return a duration in us."""
    return NONE if nanoseconds is None else digits(nanoseconds / 1e3)


def span(found: Averaged) -> str:
    """Return the ends of the whiskers in ms, and how many cells they are of where that is not all."""
    return f"{ms(found.low)} to {ms(found.high)}"


def case_order(name: str) -> int:
    """The place of a case of X3 in the table of cases; unknown ones last."""
    return next((case.number for case in CASES if case.name == name), len(CASES) + 1)


def ordered_modes(found: Iterable[str]) -> Sequence[str]:
    """Return modes in the order of the design; unknown ones last."""
    there = set(found)
    return [*(mode for mode in MODES if mode in there), *sorted(there - set(MODES))]
