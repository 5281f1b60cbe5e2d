"""A runtime that does not wait for the disk: its log says so, and the audit names the first decision that was sent
before it was stored.
"""

from reference.forgery import edit, expect, flight, prove, read, signed
from rtshcua.model.durability import BUFFERED, SYNCED, SYNCED_FIRST, WRITTEN
from virtual.rows import rows


def decisions() -> list[tuple[int, int, str, int]]:
    """(record, step, outcome, durability) of the decisions about steps."""
    found = [(number, read(line)) for number, line in enumerate(flight())]
    return [
        (number, each["step"], each["outcome"], each["durability"])
        for number, each in found
        if each["type"] == "decision" and each["kind"] == 0
    ]


def test_record_of_arming_is_synced_before_sending() -> None:
    assert [(step, outcome, durability) for _, step, outcome, durability in decisions()] == [
        (0, "allow", SYNCED_FIRST),
        (1, "allow", SYNCED),
        (2, "allow", SYNCED),
    ]
    assert prove(flight()).report.failure is None


@rows("number", [0, 1, 2])
@rows("claimed", [BUFFERED, WRITTEN, SYNCED, SYNCED_FIRST])
def test_decision_recorded_less_durably_is_detected(number: int, claimed: int) -> None:
    record, _, _, durability = decisions()[number]
    lines = list(flight())
    lines[record] = edit(lines[record], durability=claimed)
    if claimed == durability:
        assert prove(signed(lines)).report.failure is None
    else:
        assert expect(signed(lines)) == ("decision/durability", record)
