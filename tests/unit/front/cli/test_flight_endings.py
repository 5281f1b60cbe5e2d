"""Each way to end a flight has its exit code; only a completed mission has 0."""

from rtshcua.app.fly.flight_session import EXIT_CODES
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.onboard.ports import Ending


def test_every_ending_has_an_exit_code() -> None:
    assert set(EXIT_CODES) == set(Ending)
    assert [ending for ending, code in EXIT_CODES.items() if code is ExitCode.OK] == [Ending.COMPLETED]


def test_a_crash_has_a_code_of_its_own() -> None:
    assert [ending for ending, code in EXIT_CODES.items() if code is ExitCode.CRASHED] == [Ending.CRASHED]
