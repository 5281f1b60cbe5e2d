"""E1401, E1402, E1407: a test says what is asked, from where it starts, and what must be decided.

Only those of the file that was asked for are looked at: the tests of an imported file are its own business.
"""

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.arguments import bind_value, pair
from rtshcua.ground.checker.checks.expectations import check_expectation
from rtshcua.ground.checker.checks.premises import check_asker, check_premises
from rtshcua.ground.checker.checks.tables import check_table, columns_of, unranged
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.lookup import find_skill
from rtshcua.ground.checker.starts import Start, nominal_of, start_of
from rtshcua.ground.checker.symbols import correction, suggestion
from rtshcua.ground.language.wording import short
from rtshcua.model.ir.expression import Reference
from rtshcua.model.ir.skills import ArgumentValue, SkillDecl
from rtshcua.model.ir.tests import Request, TestDecl

#: of one file; beyond that a generator went wild, and nobody reads what they find
MAX_CASES = 4096


def check_tests(context: Context) -> None:
    """Report every test that does not say what it must, or says what cannot be."""
    tests = context.symbols.tests
    if _too_many(context, tests):
        return
    seen: dict[str, TestDecl] = {}
    for test in tests:
        first = seen.setdefault(test.name.text, test)
        if first is not test:
            context.report.add(
                codes.SAME_TEST,
                test.name.span,
                f"two tests are called `{short(test.name.text)}`",
                help="give it another name: reports tell tests by their names",
                labels=[(first.name.span, "the first one")],
            )
        _check(context, test)


def _too_many(context: Context, tests: tuple[TestDecl, ...]) -> bool:
    count = 0
    for test in tests:
        count += 1 if test.table is None else len(test.table.rows)
        if count > MAX_CASES:
            context.report.add(
                codes.TOO_MANY,
                test.name.span,
                f"with this test the file has more than {MAX_CASES} cases, and so many are run of one file",
                help="split it into several files",
            )
            return True
    return False


def _check(context: Context, test: TestDecl) -> None:
    check_premises(context, test.premises)
    request = test.request
    if request is None:
        _lacks(context, test, "what is asked", "add `when` and a request, as in `when hover(10 s) by role operator`")
    else:
        check_asker(context, request.asker)
    if (test.expectation is None) == (test.table is None):
        _lacks(
            context,
            test,
            "what must be decided" if test.table is None else "which decision is meant: it has a table too",
            "add `expect` and an outcome, or a `table`" if test.table is None else "keep `expect`, or the `table`",
        )
    nominal = nominal_of(context, test)
    policy = None
    if nominal is not None:
        policy = context.symbols.policies.get(nominal.policy.text)
        _complete(context, test, start_of(test, nominal))
    skill = None if request is None else find_skill(context, request.skill)
    if request is not None and skill is not None:
        check_request(context, test, request, skill)
    if test.table is not None:
        check_table(context, test, test.table, skill)
    for expected in (
        *(() if test.expectation is None else (test.expectation,)),
        *(() if test.table is None else (row.expectation for row in test.table.rows)),
    ):
        check_expectation(context, expected, skill, policy)


def _lacks(context: Context, test: TestDecl, what: str, help: str) -> None:
    message = f"the test does not say {what}"
    context.report.add(codes.INCOMPLETE_TEST, test.name.span, message, help=help)


def _complete(context: Context, test: TestDecl, start: Start) -> None:
    """Report what neither the test nor its nominal says; nothing is made up."""
    lacking = [
        (what, help)
        for said, what, help in (
            (start.role, "who asks", "`by role operator through agent`"),
            (start.instant, "when it is", '`at "2026-06-01T08:00:00Z"`'),
            (start.phase, "in which phase of its mission that is", "`phase inspection`"),
        )
        if said is None
    ]
    for what, help in lacking:
        context.report.add(
            codes.INCOMPLETE_TEST,
            test.name.span,
            f"neither the test nor its nominal says {what}",
            help=f"add it to the nominal, as in {help}",
            labels=[(start.nominal.name.span, "it starts from here")],
        )
    if start.phase is not None and start.phase.phase.text not in {name.text for name in start.order}:
        names = [name.text for name in start.order]
        context.report.add(
            codes.UNKNOWN_NAME,
            start.phase.phase.span,
            f"`{start.phase.phase.text}` is none of the phases of the mission",
            help=suggestion(start.phase.phase.text, names) or "they are " + ", ".join(f"`{each}`" for each in names),
            fix=correction(context.report, start.phase.phase.span, start.phase.phase.text, names),
            labels=[(start.order[0].span.to(start.order[-1].span), "its phases in order")],
        )


def check_request(context: Context, test: TestDecl, request: Request, skill: SkillDecl) -> None:
    """Report arguments that do not fit their parameters. One out of its range does: the decision denies it."""
    columns = () if test.table is None else columns_of(test.table, skill)
    stand_ins = tuple(
        ArgumentValue(span=name.span, name=name, value=Reference(span=name.span, name=name.text)) for name in columns
    )
    pairs = pair(context, skill, (*request.arguments, *stand_ins), request.span)
    known = context.arguments(skill)
    for name, value in () if pairs is None else pairs.items():
        argument = known.get(name)
        if argument is not None and not any(value is each.value for each in stand_ins):
            bind_value(context.scope(), unranged(argument), value)
