"""E1405, E1406: the columns of a table, and the cells of its rows."""

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.arguments import bind_value
from rtshcua.ground.checker.checks.premises import check_cell, check_size, check_subject, once, signal_of
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.scope import Argument
from rtshcua.ground.checker.symbols import correction, suggestion
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.skills import SkillDecl
from rtshcua.model.ir.tests import Cell, Named, Row, Subject, Table, TestDecl

#: of one table; far above what anybody reads
MAX_COLUMNS = 64


def columns_of(table: Table, skill: SkillDecl) -> tuple[Name, ...]:
    """The columns that are parameters of the skill that is asked for."""
    names = {parameter.name.text for parameter in skill.parameters}
    named = (column.name for column in table.columns if isinstance(column, Named))
    return tuple(dict.fromkeys(name for name in named if name.text in names))


def unranged(argument: Argument) -> Argument:
    """A parameter without its range: what is out of it is for the decision to deny."""
    return Argument(argument.declaration, argument.type)


def check_table(context: Context, test: TestDecl, table: Table, skill: SkillDecl | None) -> None:
    """Report columns that nothing is called, and cells that do not fit their columns."""
    if len(table.columns) > MAX_COLUMNS:
        context.report.add(
            codes.TOO_MANY,
            table.columns[MAX_COLUMNS].span,
            f"the table has {len(table.columns)} columns, and at most {MAX_COLUMNS} are read",
        )
        return
    if not table.rows:
        context.report.add(
            codes.INCOMPLETE_TEST,
            test.name.span,
            "the table of the test has no row, so nothing is decided",
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


def _column(context: Context, column: Subject, arguments: dict[str, Argument], skill: SkillDecl | None) -> None:
    if not isinstance(column, Named) or signal_of(context, column) is not None:
        check_subject(context, column)
        return
    name = column.name.text
    if name in arguments or skill is None:
        return
    if context.symbols.kind_of(name) is not None:  # something else, which is said
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


def _whole(context: Context, table: Table, row: Row) -> bool:
    if len(row.cells) == len(table.columns):
        return True
    more = len(row.cells) - len(table.columns)
    words = f"{len(table.columns)} column" + ("" if len(table.columns) == 1 else "s")
    context.report.add(
        codes.ROW_CELLS,
        row.cells[0].span.to(row.cells[-1].span),
        f"this row has {len(row.cells)} cell{'' if len(row.cells) == 1 else 's'}, and the table has {words}",
        help="leave out what is too many" if more > 0 else "add what is missing; `unknown` stands for a missing signal",
        labels=[(table.columns[0].span.to(table.columns[-1].span), words)],
    )
    return False


def _cell(context: Context, column: Subject, cell: Cell, arguments: dict[str, Argument]) -> None:
    argument = arguments.get(column.name.text) if isinstance(column, Named) else None
    if argument is None:
        check_cell(context, column, cell)
    elif cell.value is None or cell.measured is not None:
        context.report.add(
            codes.WRONG_TYPE,
            cell.span,
            "an argument is never unknown" if cell.value is None else "an argument is not measured, and has no age",
            help=f"write a value for `{argument.declaration.name.text}`",
            labels=[(argument.declaration.span, "it is declared here")],
        )
    else:
        bound = bind_value(context.scope(), unranged(argument), cell.value)
        if bound is not None:
            check_size(context, cell.value, bound, argument.type.dimension)
