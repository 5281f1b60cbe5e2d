"""That a bundle flies once: looked up before anything is written, and marked before anything is sent. The mark is taken
back after a run that sent nothing.
"""

import time
from collections.abc import Iterable
from pathlib import Path
from typing import Final, Protocol

from rtshcua.adapters.clock import LinkClock
from rtshcua.adapters.store.opened_missions import FileReplayStore, looked_up
from rtshcua.adapters.vehicle.connected import ConnectedVehicle
from rtshcua.app.wording import utc
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import Now
from rtshcua.model.step_number import number_of
from rtshcua.onboard.calls import call
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Event, MissionOpening

#: How long word of whether the vehicle is in the air is waited for, in seconds.
AIR_S: Final = 5.0
#: and an answer to what is not signed.
ANSWER_S: Final = 3.0
_POLL_S: Final = 0.05
_MEND: Final = "put `replay/` of the state folder right; without it, each bundle that has not expired opens again"


class Grounded(Protocol):
    """A flight whose log has begun."""

    @property
    def used_up(self) -> bool:
        """Whether the bundle may not fly any more, after it."""
        ...

    def refuse(self) -> None:
        """Close the log: it is not to be."""
        ...


def flown_before(state: Path, loaded: Loaded) -> str | None:
    """Why the bundle would not be opened, in words; nothing of it is used up."""
    refusal = not_opened(state, loaded)
    return None if refusal is None else refusal.text


def not_opened(state: Path, loaded: Loaded) -> Refusal | None:
    """Why the bundle would not be opened, if it would not be; nothing of it is used up."""
    opening = _looked_up(state, loaded)
    return None if opening is MissionOpening.OPENED else _not_opened(loaded, opening)


def _looked_up(state: Path, loaded: Loaded) -> MissionOpening:
    policy, digest = loaded.bundle.policy, loaded.bundle.mission_digest
    return looked_up(state, loaded.vehicle, digest, loaded.expires_us, policy.name, policy.version)


def _not_opened(loaded: Loaded, opening: MissionOpening) -> Refusal:
    policy, vehicle = loaded.bundle.policy, loaded.vehicle
    if opening is MissionOpening.DAMAGED:
        text = f"what is kept about the bundles that `{vehicle}` opened is damaged: this one may have flown"
        return Refusal(opening, text, _MEND, ExitCode.REFUSED)
    if opening is MissionOpening.OLD_POLICY:
        text = f"a later version of `{policy.name}` than {policy.version} was in force on `{vehicle}`"
        help = "compile the mission again under the policy in force; `--fresh-state` forgets it, in simulation"
        return Refusal(opening, text, help, ExitCode.REFUSED)
    text = f"this bundle was opened before on `{vehicle}`: a bundle flies once"
    return Refusal(opening, text, "compile the mission again, which issues it anew", ExitCode.REFUSED)


def expired(loaded: Loaded, now: Now) -> Refusal | None:
    """Why the mission in force could not fly to its end any more (`too_old`)."""
    return too_old(loaded.bundle.policy, [prepared.invocation for prepared in loaded.invocations], now)


def too_old(policy: Policy, steps: Iterable[Invocation], now: Now) -> Refusal | None:
    """Why a mission of these steps could not fly to its end any more, whatever the vehicle says: one of them has
    certainly expired. None where none has, or the time of day is not known.
    """
    for step in steps:
        end_us = step.issued_at_us + step.contract.validity_us
        if now.utc_us - now.utc_error_us > end_us:
            which = f"step {number_of(step.step)}, `{call(policy, step)}`"
            text = f"the bundle expired at {utc(end_us)}: later {which}, may not begin"
            return Refusal("bundle-expired", text, "compile the mission again, which issues it anew", ExitCode.REFUSED)
    return None


def broke_off(
    state: Path, loaded: Loaded, vehicle: ConnectedVehicle, clock: LinkClock, events: list[Event]
) -> bool | Refusal:
    """True for a bundle that was opened before while the vehicle is in the air, or armed; one that can be opened is not
    yet. A refusal for one that was opened, and nothing of it flies. Raises OSError.

    Then a run of it broke off up there, or had just told it to take off: nothing of the mission is flown again, but it
    is brought down. So it is where nobody can tell, for the state folder is damaged, or cannot be read or written: what
    flies must come down whatever that says.
    """
    unread: OSError | None = None
    try:
        opening = _looked_up(state, loaded)
        if opening is MissionOpening.OPENED:
            FileReplayStore(state, loaded.vehicle).expect_room()
    except OSError as error:
        opening, unread = MissionOpening.DAMAGED, error
    if opening is MissionOpening.OPENED:
        return False
    if opening is MissionOpening.OLD_POLICY:
        return _not_opened(loaded, opening)
    if still_flies(vehicle, clock, events):
        return True
    if unread is not None:
        raise unread
    return _not_opened(loaded, opening)


def still_flies(vehicle: ConnectedVehicle, clock: LinkClock, events: list[Event]) -> bool:
    """Whether the vehicle says, within `AIR_S`, that it is in the air, or armed. `events` get what came meanwhile."""
    seen = vehicle.driver.seen
    until_s = time.monotonic() + AIR_S
    while not seen.landed_state and time.monotonic() < until_s:
        events += vehicle.poll(clock.now().monotonic_us, clock.us_in(_POLL_S))
    return bool(seen.airborne or seen.armed)


def obeys(vehicle: ConnectedVehicle, clock: LinkClock, events: list[Event]) -> bool:
    """Whether the vehicle takes what is not signed, or answers, within `ANSWER_S`, what it is asked so. `events` get
    what came meanwhile.
    """
    until_s = time.monotonic() + ANSWER_S
    while vehicle.driver.keyless and time.monotonic() < until_s:
        events += vehicle.poll(clock.now().monotonic_us, clock.us_in(_POLL_S))
    return not vehicle.driver.keyless


def mark_opened(state: Path, loaded: Loaded, clock: LinkClock, flight: Grounded) -> Refusal | None:
    """Open the bundle, which works once: after the first record is on the disk, so that a disk that is full uses up no
    bundle, and before anything is sent. Another run may have been faster; then this one does not fly.
    """
    policy, now = loaded.bundle.policy, clock.now()
    earliest_us = now.utc_us - now.utc_error_us  # nothing is forgotten that may not have expired yet
    try:
        opening = FileReplayStore(state, loaded.vehicle).open_once(
            loaded.bundle.mission_digest, loaded.expires_us, earliest_us, policy.name, policy.version
        )
    except OSError:
        flight.refuse()
        raise
    if opening is MissionOpening.OPENED:
        return None
    flight.refuse()
    return _not_opened(loaded, opening)


def give_back(state: Path, loaded: Loaded, flight: Grounded, now: Now) -> str | None:
    """After a run that ended with nothing sent: its bundle may be handed in again, unless it expired meanwhile; that,
    in words. None if it was used.

    A run that was killed, or ended by a fault, gives nothing back: what it sent is not known.
    """
    if flight.used_up:
        return None
    try:
        FileReplayStore(state, loaded.vehicle).give_back(loaded.bundle.mission_digest)
    except OSError as error:
        return f"no command was sent, but the bundle counts as flown: {error.strerror or error}"
    late = expired(loaded, now)
    if late is not None:
        return f"no command was sent, and {late.text}; {late.help}"
    return "no command was sent: the bundle can be run again"
