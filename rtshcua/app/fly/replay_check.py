"""A bundle flies once. The replay store is read before anything is written, and the bundle is marked as opened before
anything is sent. After a run that sent nothing the mark is removed.
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

#: how long a report whether the vehicle is in the air is awaited, in seconds
AIR_S: Final = 5.0
#: how long an answer to an unsigned message is awaited, in seconds
ANSWER_S: Final = 3.0
_POLL_S: Final = 0.05
_MEND: Final = "restore `replay/` in the state folder; without it, each bundle that has not expired can fly again"


class Grounded(Protocol):
    """A flight that does not take off, although its log has begun."""

    @property
    def used_up(self) -> bool:
        """Whether the bundle cannot fly again after this flight."""
        ...

    def refuse(self) -> None:
        """Close the log of a flight that does not take place."""
        ...


def flown_before(state: Path, loaded: Loaded) -> str | None:
    """The reason why the bundle cannot be opened, as text; None if it can. The store is not changed."""
    refusal = not_opened(state, loaded)
    return None if refusal is None else refusal.text


def not_opened(state: Path, loaded: Loaded) -> Refusal | None:
    """The refusal if the bundle cannot be opened; None if it can. The store is not changed."""
    opening = _looked_up(state, loaded)
    return None if opening is MissionOpening.OPENED else _not_opened(loaded, opening)


def _looked_up(state: Path, loaded: Loaded) -> MissionOpening:
    policy, digest = loaded.bundle.policy, loaded.bundle.mission_digest
    return looked_up(state, loaded.vehicle, digest, loaded.expires_us, policy.name, policy.version)


def _not_opened(loaded: Loaded, opening: MissionOpening) -> Refusal:
    policy, vehicle = loaded.bundle.policy, loaded.vehicle
    if opening is MissionOpening.DAMAGED:
        text = f"the record of the bundles that `{vehicle}` opened is damaged: this bundle may have flown before"
        return Refusal(opening, text, _MEND, ExitCode.REFUSED)
    if opening is MissionOpening.OLD_POLICY:
        text = f"`{vehicle}` has already flown under a later version of `{policy.name}` than {policy.version}"
        help = "compile the mission again under the later policy; in simulation, `--fresh-state` clears the record"
        return Refusal(opening, text, help, ExitCode.REFUSED)
    text = f"this bundle was opened before on `{vehicle}`: a bundle flies once"
    return Refusal(opening, text, "compile the mission again to issue a new bundle", ExitCode.REFUSED)


def expired(loaded: Loaded, now: Now) -> Refusal | None:
    """The refusal if the mission in force is too old to fly to its end (`too_old`)."""
    return too_old(loaded.bundle.policy, [prepared.invocation for prepared in loaded.invocations], now)


def too_old(policy: Policy, steps: Iterable[Invocation], now: Now) -> Refusal | None:
    """The refusal if one of these steps has certainly expired, so that the mission cannot fly to its end. None if none
    has, or if UTC is unknown.
    """
    for step in steps:
        end_us = step.issued_at_us + step.contract.validity_us
        if now.utc_us - now.utc_error_us > end_us:
            which = f"step {number_of(step.step)}, `{call(policy, step)}`"
            text = f"the bundle expired at {utc(end_us)}: after that time {which}, may not begin"
            return Refusal("bundle-expired", text, "compile the mission again to issue a new bundle", ExitCode.REFUSED)
    return None


def broke_off(
    state: Path, loaded: Loaded, vehicle: ConnectedVehicle, clock: LinkClock, events: list[Event]
) -> bool | Refusal:
    """True if an earlier run of the bundle broke off: the bundle was opened before, and the vehicle is armed or in the
    air. False if the bundle can be opened. A refusal if it was opened before and the vehicle is on the ground.
    Raises OSError.

    After an earlier run broke off, no step of the mission is flown again; the vehicle is brought down. The same holds
    if the state folder is damaged or cannot be read or written, because a vehicle in the air must come down.
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
    """Whether the vehicle reports within `AIR_S` that it is armed or in the air. Appends the received events to
    `events`.
    """
    seen = vehicle.driver.seen
    until_s = time.monotonic() + AIR_S
    while not seen.landed_state and time.monotonic() < until_s:
        events += vehicle.poll(clock.now().monotonic_us, clock.us_in(_POLL_S))
    return bool(seen.airborne or seen.armed)


def obeys(vehicle: ConnectedVehicle, clock: LinkClock, events: list[Event]) -> bool:
    """Whether the vehicle accepts unsigned messages, or answers one within `ANSWER_S`. Appends the received events to
    `events`.
    """
    until_s = time.monotonic() + ANSWER_S
    while vehicle.driver.keyless and time.monotonic() < until_s:
        events += vehicle.poll(clock.now().monotonic_us, clock.us_in(_POLL_S))
    return not vehicle.driver.keyless


def mark_opened(state: Path, loaded: Loaded, clock: LinkClock, flight: Grounded) -> Refusal | None:
    """Mark the bundle as opened, which works once. Called after the first record is on the disk, so that a full disk
    does not use up a bundle, and before anything is sent. A refusal if another run opened the bundle first.
    """
    policy, now = loaded.bundle.policy, clock.now()
    earliest_us = now.utc_us - now.utc_error_us  # entries that may not have expired yet are kept
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
    """After a run that sent nothing, remove the mark, so that the bundle can fly. Return a note for the user; None if
    the bundle is used up.

    After a run that was killed or failed the mark stays, because it is unknown what the run sent.
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
