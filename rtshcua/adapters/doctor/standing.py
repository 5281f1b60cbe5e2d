"""How a vehicle stands to its qualification record, in words."""

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Final, NamedTuple

from rtshcua.wire.qualification import CheckOutcome, Firmware, Qualification

#: the sorties without which a qualification is a partial one; a real vehicle flies its takeovers only when asked to
WHOLE: Final = ("climb", "leg")


class Standing(NamedTuple):
    """Whether a record holds for it as it is now; and that in words, or why not."""

    qualified: bool
    text: str


def unflown(record: Qualification) -> list[str]:
    """The sorties of a whole qualification that a partial one (`--only`) left out. Takeovers are none of them."""
    flown = {each.slug for each in record.checks}
    return [name for name in WHOLE if f"sortie/{name}" not in flown]


def standing(record: Qualification | str | None, firmware: Firmware | None, known: Mapping[str, bytes]) -> Standing:
    """How a vehicle stands that tells this firmware and these parameters. A text in place of the record says why it is
    not to be trusted; None: there is none. What was flown in a simulation alone qualifies no
    vehicle: nobody here can tell whether it is one, for both may have the same identity and address.
    """
    if record is None:
        return Standing(False, "this vehicle is not qualified: there is no record of a flight test of its autopilot")
    if isinstance(record, str):
        return Standing(False, f"this vehicle is not qualified: its record is not to be trusted: {record}")
    failed = [each.slug for each in record.failed]
    if not record.qualifies:
        what = f"{_many(len(failed))} did not hold: {', '.join(failed)}" if failed else "nothing was checked"
        return Standing(False, f"this vehicle is not qualified: {what}")
    day = datetime.fromtimestamp(record.issued_at_us / 1_000_000, UTC).date().isoformat()
    changes = record.changes(firmware, known)
    if changes:
        return Standing(False, f"this vehicle was qualified on {day}, and is another now: {'; '.join(changes)}")
    if not record.pilot:
        return Standing(False, f"this vehicle was qualified in simulation only, on {day}")
    left_out = unflown(record)
    if left_out:
        text = f"this vehicle is partly qualified only: not flown: {', '.join(left_out)} (`--only`)"
        return Standing(False, text)
    held = sum(each.outcome == CheckOutcome.HELD for each in record.checks)
    left = sum(each.outcome == CheckOutcome.UNCHECKED for each in record.checks)
    unsaid = [] if firmware is not None else ["it does not tell its version now"]
    missing = len(dict(record.parameters).keys() - known.keys())
    if missing:
        unsaid.append(f"{missing} of its parameters are not told now")
    more = f"; {'; '.join(unsaid)}" if unsaid else ""
    return Standing(
        not unsaid,
        f"qualified on {day} for {record.firmware.text}: {_many(held)} {'holds' if held == 1 else 'hold'}, "
        f"{left} {'was' if left == 1 else 'were'} not made{more}",
    )


def _many(checks: int) -> str:
    return f"{checks} check" if checks == 1 else f"{checks} checks"
