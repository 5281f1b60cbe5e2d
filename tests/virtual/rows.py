"""One test over the rows of a table.

A separate test costs several milliseconds of overhead, partly in each process of a run. For a row that is a single
function call, that is most of its cost.
"""

import inspect
from collections.abc import Callable, Iterable, Sequence
from functools import wraps
from typing import Any

import pytest

Test = Callable[..., None]
#: the most characters of a row that a failure shows
LONG = 500


def rows(names: str | Sequence[str], table: Iterable[Any], *, ids: Any = None) -> Callable[[Test], Test]:
    """Like `pytest.mark.parametrize`, but as one test: it runs every row and reports all failing rows.

    For tests without side effects. All rows share fixtures, so only fixtures of a module or of the session are allowed.
    Rows with marks stay parameters.
    """
    argnames = [name.strip() for name in names.split(",")] if isinstance(names, str) else list(names)
    single = len(argnames) == 1
    named = ids if ids is None or callable(ids) else list(ids)
    every = []
    for at, row in enumerate(table):
        marked = isinstance(row, type(pytest.param()))
        values = row.values if marked else (row,) if single else tuple(row)
        assert not (marked and row.marks), "a row with a mark is a test of its own"
        assert len(values) == len(argnames), f"row {at + 1} has {len(values)} values for {argnames}"
        every.append((row.id if marked else None, values))
    assert every, "a table without rows tests nothing"

    def made(test: Test) -> Test:
        @wraps(test)
        def run(**fixtures: Any) -> None:
            failed: list[BaseException] = []
            for at, (id, values) in enumerate(every):
                try:
                    test(**fixtures, **dict(zip(argnames, values, strict=True)))
                except (Exception, pytest.fail.Exception) as error:  # noqa: BLE001  told with the others
                    error.add_note(f"in {_name(at, id, values, argnames, named)}")
                    failed.append(error)
            if failed:
                raise BaseExceptionGroup(f"{len(failed)} of {len(every)} rows", failed)

        signature = inspect.signature(test)
        left = [each for each in signature.parameters.values() if each.name not in argnames]
        assert len(left) + len(argnames) == len(signature.parameters), f"{test.__name__} does not take {argnames}"
        run.__signature__ = signature.replace(parameters=left)  # type: ignore[attr-defined]
        return run

    return made


def _name(at: int, id: object, values: Sequence[Any], argnames: Sequence[str], ids: Any) -> str:
    """Describe a row by its number, its name and its values."""
    if id is None and callable(ids):
        id = "-".join(str(ids(value)) for value in values)
    elif id is None and ids is not None:
        id = ids[at]
    told = ", ".join(f"{name}={value!r}" for name, value in zip(argnames, values, strict=True))
    shown = told if len(told) <= LONG else f"{told[:LONG]} …"
    return f"row {at + 1}: {shown}" if id is None else f"row {at + 1} ({id}): {shown}"
