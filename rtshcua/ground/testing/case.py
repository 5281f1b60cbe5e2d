"""A case: one request in one situation, and what must be decided. A test is one; with a table, each row is.

`case_lowering` makes the cases of a program, `case_result.run_case` decides one of them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.lower.policy import LoweredPolicy
from rtshcua.model.decision import Decisive
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Link
from rtshcua.model.flat.policy import Airspace, Rule
from rtshcua.model.flat.situation import Context, Now, State
from rtshcua.model.ir.tests import Expectation, NominalDecl, TestDecl


@dataclass(frozen=True, slots=True, eq=False)
class PolicyUnderTest:
    """A policy for a vehicle as tests need it: lowered, and prepared as on board. Made once for all its cases."""

    lowered: LoweredPolicy
    prepared: PreparedPolicy

    @property
    def name(self) -> str:
        """The policy's name."""
        return self.lowered.policy.name

    def span(self, part: Clause | Rule | Link | Airspace) -> Span:
        """Where a part of the policy, or of a contract under it, is written."""
        return self.lowered.files.span(part.source, part.start, part.end)

    def text(self, part: Clause | Rule | Airspace) -> str:
        """All of its text, also what is too long to be carried on board: a rule's behind what made it."""
        files = self.lowered.files
        if isinstance(part, Rule):
            rule = self.lowered.written[part]
            return ": ".join(files.text(node.span) for node in (*rule.origin, rule))
        return files.text(self.span(part))


@dataclass(frozen=True, slots=True, eq=False)
class PolicyCase:
    """What is decided on, and what must be decided.

    `name` is stable: that of the test, and for a row its cells in brackets. `span` is the row, or the test's name.
    `phases` are those of the mission that the request stands in, in order. `row` is the row's number from 0, None
    without a table. `nominal` is where the test starts from.
    """

    name: str
    test: TestDecl
    row: int | None
    span: Span
    expected: Expectation
    policy: PolicyUnderTest
    invocation: PreparedInvocation
    state: State
    context: Context
    now: Now
    phases: tuple[str, ...]
    nominal: NominalDecl
    quoted: tuple[Decisive, ...] = ()


@dataclass(frozen=True, slots=True)
class CaseSuite:
    """The cases of the file that was asked for, in the order of the text; none where the sources have errors.

    `diagnostics` are all findings on the declarations and on the tests (not on what they decide), `policies` those that
    cases are under, `sources` the texts that findings speak of.
    """

    cases: tuple[PolicyCase, ...]
    diagnostics: tuple[Diagnostic, ...]
    policies: tuple[PolicyUnderTest, ...] = ()
    sources: Mapping[str, Source] = field(default_factory=dict)
