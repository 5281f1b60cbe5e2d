"""Nominals and tests: an initial state, a request, and the expected decision. Neither is part of a bundle."""

from typing import ClassVar, Literal

from rtshcua.model.ir.expression import Condition, Quantity, Value
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.skills import ArgumentValue


class Quoted(Node):
    """A quoted text: the name of a test, or a clause. The span includes the quotes, `text` does not."""

    text: str


class OverTime(Node, kw_only=True):
    """`(battery < 30 % for the last 5 s)`: a condition over time whose truth is set by hand."""

    kind: Literal["over-time"] = "over-time"
    condition: Condition


class Named(Node, kw_only=True):
    """`battery`: a signal, or in a table a parameter of the requested skill."""

    kind: Literal["named"] = "named"
    name: Name


Subject = Named | OverTime


class TableCell(Node):
    """`20 %`, `unknown` (`value` is None), `fix_3d measured 3 s ago`; `true` or `false` of a condition over time."""

    value: Value | None
    measured: Quantity | None = None  # age of the measurement


class Assignment(Node):
    """`battery = 20 %`."""

    subject: Subject
    cell: TableCell


class Instant(Node):
    """`at "2026-06-01T08:00:00Z" within 2 s`: UTC of the decision in us since the epoch, and its error."""

    utc_us: int
    within: Quantity | None


class InPhase(Node):
    """`phase departure of departure, inspection, recovery`: the mission's phase, and all of its phases in order
    (empty: only this one, or those of the nominal).
    """

    phase: Name
    order: tuple[Name, ...]


class Answer(Node):
    """`approved by role supervisor 2 s ago`, `refused by role supervisor`."""

    granted: bool
    role: Name
    ago: Quantity | None


class Issue(Node):
    """`issued 11 min ago`; `issued in 5 s`, which is ahead of the decision."""

    distance: Quantity
    ahead: bool


class VersionInForce(Node):
    """`version 8 in force`: the version of the policy on board, if it differs from that of the request."""

    version: int


class Identity(Node):
    """`identity "quad-08"`: the vehicle that receives the request, if it differs from the one that it was made for."""

    text: str


class Deed(Node):
    """`replayed`: the request's id was used before. `tampered`: the request differs from what was signed."""

    kind: Literal["replayed", "tampered"]


class Premises(Node):
    """The situation of the request; None or an empty tuple: not written. Times are ages."""

    given: tuple[Assignment, ...] = ()
    instant: Instant | None = None
    phase: InPhase | None = None
    answers: tuple[Answer, ...] = ()
    released: Quantity | None = None
    issued: Issue | None = None
    in_force: VersionInForce | None = None
    identity: Identity | None = None
    replayed: Deed | None = None
    tampered: Deed | None = None


class Asker(Node):
    """`by role operator through agent`: the role of the request and its source. Each may be omitted."""

    role: Name | None
    source: Name | None


class NominalDecl(Node):
    """`nominal morning { under bridge_inspection on quad by role operator at "..." phase inspection given ... }`: the
    initial situation of tests.
    """

    name: Name
    policy: Name
    vehicle: Name
    asker: Asker | None
    premises: Premises


class RequestDecl(Node):
    """`when inspect_area(area = bridge_a, altitude = 20 m) by operator through agent`."""

    skill: Name
    arguments: tuple[ArgumentValue, ...]
    asker: Asker | None


class Expectation(Node):
    """`expect fallback return_home because state/violated at "battery > 35 %"`. Omitted parts may have any value;
    `clause` is the text of the expected deciding clause.
    """

    outcome: Literal["allow", "deny", "defer", "fallback"]
    target: Name | None
    reason: Name | None
    clause: Quoted | None


class TableRow(Node):
    """`20 %, 3 m/s expect fallback return_home`."""

    cells: tuple[TableCell, ...]
    expectation: Expectation


class CaseTable(Node):
    """`table battery, wind.speed { ... }`: each row is a case."""

    columns: tuple[Subject, ...]
    rows: tuple[TableRow, ...]


class TestDecl(Node):
    """`test "low battery turns an inspection into a return" from morning { given ... when ... expect ... }`."""

    __test__: ClassVar[bool] = False  # tells pytest that this class is not a test

    name: Quoted
    nominal: Name | None
    premises: Premises
    request: RequestDecl | None
    expectation: Expectation | None
    table: CaseTable | None
