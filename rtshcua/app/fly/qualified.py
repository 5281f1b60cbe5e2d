"""Whether a vehicle is qualified, as `run` and `doctor` say it."""

import time
from pathlib import Path
from typing import Final

from rtshcua.adapters.clock import LinkClock
from rtshcua.adapters.doctor.identity import IdentityQuestions
from rtshcua.adapters.doctor.standing import standing
from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.qualifications import read_record
from rtshcua.adapters.vehicle.connected import ConnectedVehicle
from rtshcua.onboard.ports import Event
from rtshcua.wire.qualification import Qualification, open_qualification
from rtshcua.wire.trust import TrustRoot
from rtshcua.wire.untrusted import Untrusted

#: s that its version and parameters are waited for
_TOLD_S: Final = 4.0
_POLL_S: Final = 0.05
_HELP: Final = "`rtshcua qualify` flies a short test of it"


def record_of(vehicle: str, root: TrustRoot, now_us: int, data: Path | None = None) -> Qualification | str | None:
    """The record of the vehicle of this identity; None where it has none, a text where it is not to be trusted."""
    try:
        signed = read_record(data_folder() if data is None else data, vehicle)
        return None if signed is None else open_qualification(signed, root=root, vehicle=vehicle, now_us=now_us)
    except Untrusted as error:
        return str(error)
    except OSError as error:
        return (error.strerror or str(error)).lower()


def unqualified(
    record: Qualification | str | None, vehicle: ConnectedVehicle, clock: LinkClock
) -> tuple[str | None, list[Event]]:
    """A note for a vehicle that is not qualified as it is now, None where it is; and what happened meanwhile. It is
    asked only where there is a record that could hold, and only on the ground.
    """
    driver, events = vehicle.driver, list[Event]()
    flavour = driver.flavour
    if flavour is None or not isinstance(record, Qualification) or not record.qualifies:
        return f"{standing(record, None, {}).text} ({_HELP})", events
    questions = IdentityQuestions(flavour, names=[name for name, _ in record.parameters])
    driver.asks = questions
    until_s = time.monotonic() + _TOLD_S
    while not questions.told and time.monotonic() < until_s and not (driver.seen.airborne or driver.seen.armed):
        events += vehicle.poll(clock.now().monotonic_us, clock.us_in(_POLL_S))
    driver.asks = None
    if driver.seen.airborne or driver.seen.armed:
        return None, events
    stands = standing(record, questions.firmware, questions.parameters)
    return (None if stands.qualified else f"{stands.text} ({_HELP})"), events
