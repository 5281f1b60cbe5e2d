"""Print test results for a person: one line for each test, the coverage by clause, and a summary."""

import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby

from rtshcua.app.testing.run import TestResults
from rtshcua.app.wording import many, shorten
from rtshcua.diagnostics.diagnostic import has_errors
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.span import Span
from rtshcua.diagnostics.suggest import nearest
from rtshcua.front.cli.stdout import out, out_rendered
from rtshcua.front.cli.width import fitted
from rtshcua.ground.testing.case_result import CaseResult
from rtshcua.ground.testing.clause_coverage import PolicyCoverage, share
from rtshcua.ground.testing.coverage_goals import Goal
from rtshcua.ground.testing.reporting import ScenarioResult, clause_words, policy_name, summary_json

_GREEN, _RED, _BOLD, _END = "\033[32m", "\033[1;31m", "\033[1m", "\033[0m"
_WIDTH = 100


class TestReport:
    """Prints results, coloured if standard output is a terminal; prints nothing if `quiet`."""

    __test__ = False  # pytest collects classes named Test*

    def __init__(self, done: TestResults, chosen: str, *, verbose: bool, quiet: bool) -> None:
        self._done = done
        self._chosen = chosen
        self._verbose = verbose
        self._quiet = quiet
        terminal = sys.stdout is not None and sys.stdout.isatty()
        self._colours = terminal and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"

    def results(self) -> None:
        """Print one line for each test and scenario, below its file."""
        self._print((*self._tests(self._done.ran), *self._scenarios(self._done.flown)))

    def summary(self, least: int | None) -> None:
        """Print the coverage, the number of tests and failures, and whether coverage is below `least` percent."""
        if self._quiet:
            return
        done, covered = self._done, self._done.covered or ()
        self._print(self._coverage(covered))
        out_rendered(self._counts() if done.ran or done.flown else self._none())
        if done.falls_short(least):
            found = share(sum(one.coverage.covered for one in covered), sum(one.coverage.total for one in covered))
            out(f"coverage is {found}, below the required {least} % (`--fail-under`, or `fail-under` configured)")

    def _print(self, lines: Iterable[str]) -> None:
        for line in () if self._quiet else lines:
            for each in fitted(line):
                out_rendered(each)

    def _none(self) -> str:
        done = self._done
        if has_errors(done.diagnostics):
            return "no test was run: the sources have errors"
        if done.left_out:
            by_word = {word: name for name in sorted(done.names) for word in (*name.split(), name)}
            near = nearest(self._chosen, by_word)
            help = "" if near is None else f"; the nearest is `{by_word[near]}`"
            return f"no test was run: no name of {done.left_out} contains `{self._chosen}`{help}"
        return "no test was found; see docs/testing.md for how to write one"

    def _tests(self, ran: Sequence[CaseResult]) -> Iterator[str]:
        """Yield one line for each test, below its file; if verbose, one for each table row too."""
        for file, of_file in groupby(ran, lambda each: each.case.span.file):
            yield self._painted(visible(file), _BOLD)
            for _, group in groupby(of_file, lambda each: each.case.test.span):
                cases = list(group)
                yield self._line(cases)
                if self._verbose and cases[0].case.row is not None:
                    yield from (f"      {self._word(each.met)}  {visible(_row(each))}" for each in cases)

    def _scenarios(self, flown: Sequence[ScenarioResult]) -> Iterator[str]:
        """Yield one line for each scenario, below its file; if verbose, also the endings and the excused events."""
        for file, of_file in groupby(flown, lambda each: each.scenario.declaration.span.file):
            yield self._painted(visible(file), _BOLD)
            for each in of_file:
                flights = many(len(each.flights), "flight")
                counted = f"{each.failed} of {flights}" if each.failed else flights
                yield f"  {self._word(not each.failed)}  {visible(each.scenario.scenario.name)} ({counted})"
                if self._verbose:
                    yield "      " + ", ".join(f"{count} {ending}" for ending, count in each.endings.items())
                    excused = sorted({text for flight in each.flights for text in flight.excused})
                    yield from (f"      excused: {visible(text)}" for text in excused)

    def _coverage(self, covered: Sequence[PolicyCoverage]) -> Iterator[str]:
        """Yield the uncovered clauses; if verbose, the covered ones too."""
        for one in covered:
            yield from self._policy(one)
        if len(covered) > 1:
            reached, total = sum(one.coverage.covered for one in covered), sum(one.coverage.total for one in covered)
            yield f"\ncoverage of all: {share(reached, total)}, {reached} of {total}"

    def _counts(self) -> str:
        """Return the line with the numbers of tests, cases and failures."""
        ran, flown, left_out = self._done.ran, self._done.flown, self._done.left_out
        found = summary_json(ran)
        counts = [many(found["tests"], "test")] if ran or not flown else []
        if found["cases"] != found["tests"]:
            counts.append(many(found["cases"], "case"))
        if flown:
            counts.append(many(len(flown), "scenario"))
            counts.append(many(sum(len(each.flights) for each in flown), "flight"))
        counted = ", ".join(counts)
        failed = found["failed"] + sum(bool(each.failed) for each in flown)
        ended = f"{failed} failed" if failed else "all passed"
        others = f"; {many(left_out, 'case')} not chosen" if left_out else ""
        return self._painted(f"{counted}: {ended}", _RED if failed else _GREEN) + others

    def _line(self, cases: Sequence[CaseResult]) -> str:
        failed = sum(not each.met for each in cases)
        title = visible(cases[0].case.test.name.text)
        rows = "" if cases[0].case.row is None else f" ({many(len(cases), 'row')})"
        if failed and cases[0].case.row is not None:
            rows = f" ({failed} of {many(len(cases), 'row')})"
        return f"  {self._word(not failed)}  {title}{rows}"

    def _word(self, met: bool) -> str:
        return self._painted("ok  ", _GREEN) if met else self._painted("FAIL", _RED)

    def _policy(self, one: PolicyCoverage) -> Iterator[str]:
        found = one.coverage
        part = share(found.covered, found.total)
        head = f"coverage of {policy_name(found.policy)} on {found.policy.vehicle.name}: {part}"
        counted = f"{found.covered} of {found.total} by {many(found.decisions, 'case')}"
        yield f"\n{self._painted(visible(head), _BOLD)}, {counted}"
        for line, span in zip(found.lines, one.spans, strict=True):
            if line.missing or self._verbose:
                yield f"  {visible(self._place(span))}  {visible(shorten(clause_words(line.item), _WIDTH))}"
                missing = ["never decided" if goal is Goal.DECIDED else f"never {goal.value}" for goal in line.missing]
                yield f"      {', '.join(missing)}" if missing else "      covered"
        if found.undecided:
            yield f"  {many(len(found.undecided), 'clause')} never decided: no test would detect a change of them"

    def _place(self, span: Span | None) -> str:
        if span is None or span.file not in self._done.sources:
            return "-"
        return f"{span.file}:{self._done.sources[span.file].position(span.start).line}"

    def _painted(self, text: str, colour: str) -> str:
        return f"{colour}{text}{_END}" if self._colours else text


def _row(ran: CaseResult) -> str:
    """Return the cells of a row: a case's name without the name of its test."""
    return ran.case.name.removeprefix(ran.case.test.name.text).strip()
