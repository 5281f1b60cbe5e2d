"""The identity of an autopilot: its version and the parameters that matter, requested on the ground."""

import struct
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from typing import Any, Final, NamedTuple

from rtshcua.adapters.doctor.settings import SETTINGS
from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.flavour import AutopilotFlavour
from rtshcua.adapters.vehicle.messages import Message
from rtshcua.adapters.vehicle.parameters import VehicleParameters
from rtshcua.wire.qualification import CheckOutcome, Firmware, Qualification

_ASK_US: Final = 1_000_000
#: after this many unanswered requests a parameter counts as not reported
_TRIES: Final = 5


def firmware_of(flavour: str, version: Any) -> Firmware:
    """The firmware in AUTOPILOT_VERSION."""
    return Firmware(flavour, version.flight_sw_version, bytes(version.flight_custom_version))


def as_octets(value: float) -> bytes:
    """The value of a parameter as in a record: floats are not signed."""
    return struct.pack(">d", value)


def those_that_matter(flavour: AutopilotFlavour, values: Mapping[str, float]) -> dict[str, bytes]:
    """The parameters that a qualification covers, among those read; without those that a run itself switches."""
    switched = {name for name, _ in flavour.fence.switches}
    named = [setting.parameter for setting in SETTINGS[flavour.name] if setting.parameter not in switched]
    return {name: as_octets(values[name]) for name in sorted(named) if name in values}


class IdentityQuestions:
    """Requests version and parameters until they are answered; with `names`, only those parameters."""

    def __init__(self, flavour: AutopilotFlavour, slack: int = 1, names: Iterable[str] | None = None) -> None:
        self._flavour = flavour
        self._slack = slack
        self.values = VehicleParameters(bytewise=flavour.bytewise, slack=slack)
        self._names = [each.parameter for each in SETTINGS[flavour.name]] if names is None else [*names]
        for name in self._names:
            self.values.read(name)
        self._asked_us: int | None = None
        self._asked = 0
        #: None until reported
        self.firmware: Firmware | None = None

    @property
    def told(self) -> bool:
        """Whether everything was answered."""
        return self.firmware is not None and all(map(self.values.is_settled, self._names))

    @property
    def parameters(self) -> dict[str, bytes]:
        """The reported parameters that matter."""
        return those_that_matter(self._flavour, self.values.values)

    def due(self, system: int, now_us: int) -> list[Message]:
        """The requests to send now."""
        out = self.values.due(system, now_us)
        again = self._asked_us is None or now_us - self._asked_us >= _ASK_US * self._slack
        if self.firmware is None and self._asked <= _TRIES and again:
            self._asked_us, self._asked = now_us, self._asked + 1
            out.append(messages.request(system, "AUTOPILOT_VERSION"))
        return out

    def take(self, name: str, message: Any) -> None:
        """Take in a message of the autopilot."""
        if name == "PARAM_VALUE":
            self.values.take(message)
        elif name == "AUTOPILOT_VERSION":
            self.firmware = firmware_of(self._flavour.name, message)


#: the sorties of a complete qualification; a real vehicle flies takeovers only on request
WHOLE: Final = ("climb", "leg")


class Standing(NamedTuple):
    """Whether a vehicle is qualified now, and the reason in words."""

    qualified: bool
    text: str


def unflown(record: Qualification) -> list[str]:
    """The sorties of a complete qualification that a partial one (`--only`) left out. Takeovers are not among them."""
    flown = {each.slug for each in record.checks}
    return [name for name in WHOLE if f"sortie/{name}" not in flown]


def standing(record: Qualification | str | None, firmware: Firmware | None, known: Mapping[str, bytes]) -> Standing:
    """Whether a vehicle with this firmware and these parameters is qualified by a record. A text in place of the record
    says why the record cannot be trusted; None: no record. A flight in simulation qualifies no real vehicle, because
    both may have the same identity and address.
    """
    if record is None:
        return Standing(False, "this vehicle is not qualified: no flight test of its autopilot is on record")
    if isinstance(record, str):
        return Standing(False, f"this vehicle is not qualified: its record cannot be trusted: {record}")
    failed = [each.slug for each in record.failed]
    if not record.qualifies:
        what = f"{_many(len(failed))} did not hold: {', '.join(failed)}" if failed else "nothing was checked"
        return Standing(False, f"this vehicle is not qualified: {what}")
    day = datetime.fromtimestamp(record.issued_at_us / 1_000_000, UTC).date().isoformat()
    changes = record.changes(firmware, known)
    if changes:
        return Standing(False, f"this vehicle was qualified on {day} and has changed since: {'; '.join(changes)}")
    if not record.pilot:
        return Standing(False, f"this vehicle was qualified in simulation only, on {day}")
    left_out = unflown(record)
    if left_out:
        return Standing(False, f"this vehicle is only partly qualified: not flown: {', '.join(left_out)} (`--only`)")
    return _unchanged(record, firmware, known, day)


def _unchanged(record: Qualification, firmware: Firmware | None, known: Mapping[str, bytes], day: str) -> Standing:
    held = sum(each.outcome == CheckOutcome.HELD for each in record.checks)
    left = sum(each.outcome == CheckOutcome.UNCHECKED for each in record.checks)
    unsaid = [] if firmware is not None else ["the vehicle does not report its version now"]
    missing = len(dict(record.parameters).keys() - known.keys())
    if missing:
        unsaid.append(f"{missing} of its parameters are not reported now")
    more = f"; {'; '.join(unsaid)}" if unsaid else ""
    return Standing(
        not unsaid,
        f"qualified on {day} for {record.firmware.text}: {_many(held)} {'holds' if held == 1 else 'hold'}, "
        f"{left} {'was' if left == 1 else 'were'} not made{more}",
    )


def _many(checks: int) -> str:
    return f"{checks} check" if checks == 1 else f"{checks} checks"
