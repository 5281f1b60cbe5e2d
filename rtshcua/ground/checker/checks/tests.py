"""Check tests: each has a request, a start and an expected outcome, for each row of its table.

Only the tests of the compiled file itself are checked, not those of imported files.
"""

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.excerpt import short
from rtshcua.ground.checker.arguments import bind_value, pair
from rtshcua.ground.checker.checks.expectations import check_expectation
from rtshcua.ground.checker.checks.premises import (
    TestStart,
    check_asker,
    check_cell,
    check_premises,
    check_size,
    check_subject,
    nominal_of,
    once,
    signal_of,
    start_of,
)
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.lookup import find_skill
from rtshcua.ground.checker.name_scope import Argument
from rtshcua.ground.checker.symbols import correction, suggestion
from rtshcua.model.ir.expression import Reference
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.skills import ArgumentValue, SkillDecl
from rtshcua.model.ir.tests import CaseTable, Named, RequestDecl, Subject, TableCell, TableRow, TestDecl

#: the most test cases of one file
MAX_CASES = 4096


def check_tests(context: CheckContext) -> None:
    """Report every incomplete or invalid test."""
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
                f"two tests have the name `{short(test.name.text)}`",
                help="rename one of them: reports identify tests by name",
                labels=[(first.name.span, "first declared here")],
            )
        _check(context, test)


def _too_many(context: CheckContext, tests: tuple[TestDecl, ...]) -> bool:
    count = 0
    for test in tests:
        count += 1 if test.table is None else len(test.table.rows)
        if count > MAX_CASES:
            context.report.add(
                codes.TOO_MANY,
                test.name.span,
                f"with this test the file has more than {MAX_CASES} cases, the limit of a file",
                help="split it into several files",
            )
            return True
    return False


def _check(context: CheckContext, test: TestDecl) -> None:
    check_premises(context, test.premises)
    request = test.request
    if request is None:
        _report(context, test, "the test has no request", "add `when`, as in `when hover(10 s) by role operator`")
    else:
        check_asker(context, request.asker)
    if (test.expectation is None) == (test.table is None):
        _report(
            context,
            test,
            "the test has no expected outcome" if test.table is None else "the test has both `expect` and a `table`",
            "add `expect` and an outcome, or a `table`" if test.table is None else "remove one of them",
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


def _report(context: CheckContext, test: TestDecl, message: str, help: str) -> None:
    context.report.add(codes.INCOMPLETE_TEST, test.name.span, message, help=help)


def _complete(context: CheckContext, test: TestDecl, start: TestStart) -> None:
    """Report what both the test and its nominal lack; there are no defaults."""
    lacking = [
        (what, help)
        for value, what, help in (
            (start.role, "the requester", "`by role operator through agent`"),
            (start.instant, "the time", '`at "2026-06-01T08:00:00Z"`'),
            (start.phase, "the phase of the mission", "`phase inspection`"),
        )
        if value is None
    ]
    for what, help in lacking:
        context.report.add(
            codes.INCOMPLETE_TEST,
            test.name.span,
            f"neither the test nor its nominal gives {what}",
            help=f"add it to the nominal, as in {help}",
            labels=[(start.nominal.name.span, "the nominal of the test")],
        )
    if start.phase is not None and start.phase.phase.text not in {name.text for name in start.order}:
        names = [name.text for name in start.order]
        context.report.add(
            codes.UNKNOWN_NAME,
            start.phase.phase.span,
            f"`{start.phase.phase.text}` is not a phase of the mission",
            help=suggestion(start.phase.phase.text, names)
            or "its phases are " + ", ".join(f"`{each}`" for each in names),
            fix=correction(context.report, start.phase.phase.span, start.phase.phase.text, names),
            labels=[(start.order[0].span.to(start.order[-1].span), "its phases in order")],
        )


def check_request(context: CheckContext, test: TestDecl, request: RequestDecl, skill: SkillDecl) -> None:
    """Report arguments of a wrong type. A value outside the range is valid: the decision denies it."""
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


#: the most columns of one table
MAX_COLUMNS = 64


def columns_of(table: CaseTable, skill: SkillDecl) -> tuple[Name, ...]:
    """Return the columns that are parameters of the requested skill."""
    names = {parameter.name.text for parameter in skill.parameters}
    named = (column.name for column in table.columns if isinstance(column, Named))
    return tuple(dict.fromkeys(name for name in named if name.text in names))


def unranged(argument: Argument) -> Argument:
    """Return a parameter without its range, because the decision denies values outside it."""
    return Argument(argument.declaration, argument.type)


def check_table(context: CheckContext, test: TestDecl, table: CaseTable, skill: SkillDecl | None) -> None:
    """Report unknown columns, and cells that do not fit their columns."""
    if len(table.columns) > MAX_COLUMNS:
        context.report.add(
            codes.TOO_MANY,
            table.columns[MAX_COLUMNS].span,
            f"the table has {len(table.columns)} columns; the limit is {MAX_COLUMNS}",
        )
        return
    if not table.rows:
        context.report.add(
            codes.INCOMPLETE_TEST,
            test.name.span,
            "the table of the test has no row",
            help="add a row, as in `20 %, 3 m/s expect allow`",
            labels=[(table.span, "the table")],
        )
    arguments = {} if skill is None else context.arguments(skill)
    for column in table.columns:
        _column(context, column, arguments, skill)
    given = [(each.subject, each.span) for each in test.premises.given]
    once(context, [*given, *((column, column.span) for column in table.columns)])
    for row in table.rows:
        if _whole(context, table, row):
            for column, cell in zip(table.columns, row.cells, strict=True):
                _cell(context, column, cell, arguments)


def _column(context: CheckContext, column: Subject, arguments: dict[str, Argument], skill: SkillDecl | None) -> None:
    if not isinstance(column, Named) or signal_of(context, column) is not None:
        check_subject(context, column)
        return
    name = column.name.text
    if name in arguments or skill is None:
        return
    if context.symbols.kind_of(name) is not None:  # another kind of declaration, which is reported
        check_subject(context, column)
    elif name not in context.symbols.broken:
        near = suggestion(name, [*context.symbols.signals, *arguments])
        takes = ", ".join(f"`{each}`" for each in arguments)
        context.report.add(
            codes.UNKNOWN_NAME,
            column.span,
            f"`{name}` is neither a signal nor a parameter of `{skill.name.text}`",
            help=near or (f"its parameters are {takes}" if takes else None),
            fix=correction(context.report, column.span, name, [*context.symbols.signals, *arguments]),
            labels=[(skill.name.span, f"`{skill.name.text}` is declared here")],
        )


def _whole(context: CheckContext, table: CaseTable, row: TableRow) -> bool:
    if len(row.cells) == len(table.columns):
        return True
    more = len(row.cells) - len(table.columns)
    words = f"{len(table.columns)} column" + ("" if len(table.columns) == 1 else "s")
    context.report.add(
        codes.ROW_CELLS,
        row.cells[0].span.to(row.cells[-1].span),
        f"the row has {len(row.cells)} cell{'' if len(row.cells) == 1 else 's'}, but the table has {words}",
        help="remove the extra cells" if more > 0 else "add the missing cells; write `unknown` for a missing signal",
        labels=[(table.columns[0].span.to(table.columns[-1].span), words)],
    )
    return False


def _cell(context: CheckContext, column: Subject, cell: TableCell, arguments: dict[str, Argument]) -> None:
    argument = arguments.get(column.name.text) if isinstance(column, Named) else None
    if argument is None:
        check_cell(context, column, cell)
    elif cell.value is None or cell.measured is not None:
        context.report.add(
            codes.WRONG_TYPE,
            cell.span,
            "an argument cannot be unknown" if cell.value is None else "an argument has no age",
            help=f"write a value for `{argument.declaration.name.text}`",
            labels=[(argument.declaration.span, "declared here")],
        )
    else:
        bound = bind_value(context.scope(), unranged(argument), cell.value)
        if bound is not None:
            check_size(context, cell.value, bound, argument.type.dimension)
