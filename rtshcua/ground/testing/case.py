"""A case: one request in one situation, and the expected decision. A test is one case, or one for each row of a table.

`case_lowering` makes the cases of a program, `case_result.run_case` decides a case.
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
    """A policy for a vehicle, lowered and prepared as on board. All its cases share it."""

    lowered: LoweredPolicy
    prepared: PreparedPolicy

    @property
    def name(self) -> str:
        """The policy's name."""
        return self.lowered.policy.name

    def span(self, part: Clause | Rule | Link | Airspace) -> Span:
        """The span of a part of the policy, or of a contract."""
        return self.lowered.files.span(part.source, part.start, part.end)

    def text(self, part: Clause | Rule | Airspace) -> str:
        """The full text of a part, even if it is too long for the vehicle; a rule comes after the text that made it."""
        files = self.lowered.files
        if isinstance(part, Rule):
            rule = self.lowered.written[part]
            return ": ".join(files.text(node.span) for node in (*rule.origin, rule))
        return files.text(self.span(part))


@dataclass(frozen=True, slots=True, eq=False)
class PolicyCase:
    """A request in a situation, and the expected decision.

    `name` is stable: the name of the test, and for a row its cells in brackets. `span` is the row, or the test's name.
    `phases` are those of the request's mission, in order. `row` is the row's number from 0, None without a table.
    `nominal` is the nominal from which the test starts.
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
    """The cases of the first file, in source order; none if the sources have errors.

    `diagnostics` are all findings on the declarations and the tests (not on decisions), `policies` those of the cases,
    `sources` the texts to which findings refer.
    """

    cases: tuple[PolicyCase, ...]
    diagnostics: tuple[Diagnostic, ...]
    policies: tuple[PolicyUnderTest, ...] = ()
    sources: Mapping[str, Source] = field(default_factory=dict)
