"""The vehicle is met: its first heartbeat, that it is the only one, and what is said when it is not heard."""

import time
from collections.abc import Sequence
from errno import ENOENT
from typing import Any, Final

from rtshcua.adapters.clock import LinkClock
from rtshcua.adapters.utc import UtcWatch, certain_from_us
from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.address import Address, LinkCarrier
from rtshcua.adapters.vehicle.connected import ConnectedVehicle
from rtshcua.adapters.vehicle.messages import Message
from rtshcua.app.fly.interrupts import Interrupts
from rtshcua.app.fly.link_signing import Signing
from rtshcua.app.fly.refused import Refused
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.onboard.ports import Event
from rtshcua.simulation.simulated_mark import hundredths, marked_speed

#: How long a heartbeat is waited for, in seconds,
HEARTBEAT_S = 10.0
#: and another vehicle's, which comes each second; from then on it only keeps this one from being ready
ANOTHER_S = 1.5
#: and so long that it says that it is simulated, where it is held to be
SPEED_S = 10.0

#: what to do where a link cannot be opened, by what carries it
PORT_HELP: Final = {
    LinkCarrier.UDP_IN: "another program may listen there; a vehicle can be told to send to another port",
    LinkCarrier.UDP_OUT: "is it the address of a machine that this one reaches?",
    LinkCarrier.TCP: "is it the address of a machine that this one reaches?",
    LinkCarrier.TCP_IN: "another program may listen there; a vehicle can be told to connect to another port",
    LinkCarrier.SERIAL: "end the program that has it open (ModemManager, a ground station, a shell on the console); "
    "the group `dialout` may open serial devices; `ls /dev/serial/by-id` shows which there are",
}

_NO_DEVICE: Final = "is it plugged in? `ls /dev/serial/by-id` shows which there are"


def unopened(link: Address, error: OSError) -> Refusal:
    """That a link cannot be opened, and what to do."""
    verb = "listen at" if link.way in (LinkCarrier.UDP_IN, LinkCarrier.TCP_IN) else "open"
    missing = link.way is LinkCarrier.SERIAL and error.errno == ENOENT
    help = _NO_DEVICE if missing else PORT_HELP[link.way]
    return Refusal("port", f"cannot {verb} `{link}`: {(error.strerror or str(error)).lower()}", help)


#: How long the vehicle's time is waited for where the operator stated how far ours is off, in seconds
UTC_S = 3.0
#: and so long before a flight, once nothing else keeps the vehicle from being ready
READY_UTC_S: Final = 10.0
#: when a mission may begin, in us, while that is not known: never
_UNDATED_US: Final = 2**62
UTC_NOTE: Final = (
    "nothing tells how far this machine's time of day is off: until the vehicle does, steps are deferred "
    "(`--utc-error 500ms` states it)"
)
#: the same where the boundary is a process of its own, and the link has no key
APART_UTC_NOTE: Final = (
    "this machine's clock is not synchronised, and the boundary takes the vehicle's time over a link with a key alone: "
    "steps are deferred (`--signing-key`, or `--utc-error 500ms` states how far it is off)"
)
#: the same where the boundary is one that listens
LISTENING_UTC_NOTE: Final = (
    "the boundary does not know the time of day: this machine's clock is not synchronised, and the vehicle has not "
    "told its own over a link with a key; steps are deferred (`--utc-error US` in the boundary's own command line "
    "states it)"
)

_POLL_S = 0.05
_HELP: Final = "is it on, and does it send there? PX4 and ArduPilot are known; `rtshcua sim` starts one to try"
_KEY_HELP: Final = "has the vehicle the key of `--signing-key`, and are both clocks right?"
_SILENCE_HELP: Final = "look at the address, the cable and the vehicle's own port settings"
_SYSTEM_HELP: Final = "`--system` names another id, or leave it out"


def unmet(where: str, seconds: float, system: int | None, rejected: str | None, silence: str | None) -> Refusal:
    """That no heartbeat came within so many seconds, and what to do. `rejected` is what came and was not believed,
    `silence` what else is known of why nothing is heard.
    """
    of = where if system is None else f"system {system} of {where}"
    text = f"no heartbeat of {of} within {seconds:.0f} s"
    if rejected is not None:
        return Refusal("no-vehicle", f"{text}: {rejected}", _KEY_HELP)
    if silence is not None:
        return Refusal("no-vehicle", f"{text}: {silence}", _SILENCE_HELP)
    return Refusal("no-vehicle", text, _HELP if system is None else _SYSTEM_HELP)


class SpeedQuestion:
    """Asks a vehicle whether it is one that this program simulates, and how fast that lives, until it is answered."""

    #: s of the machine's time between two requests: how fast the vehicle lives is what is asked
    EACH_S: Final = 0.25

    def __init__(self) -> None:
        self._asked_s: float | None = None
        #: whether it was answered,
        self.told = False
        #: and its pace, times 100; None where it is not simulated by this program
        self.speed: int | None = None

    def due(self, system: int, now_us: int) -> Sequence[Message]:
        """The request, where it is due."""
        now_s = time.monotonic()
        if self.told or (self._asked_s is not None and now_s - self._asked_s < self.EACH_S):
            return ()
        self._asked_s = now_s
        return (messages.request(system, "AUTOPILOT_VERSION"),)

    def take(self, name: str, message: Any) -> None:
        """A message of the autopilot."""
        if name == "AUTOPILOT_VERSION":
            self.told, self.speed = True, marked_speed(message)


def unlike(question: SpeedQuestion, speed: float) -> Refusal | None:
    """Why a vehicle that answered so, or not at all, is not flown at `speed` seconds of flight in a second; None where
    it lives so fast. What it said is enough: no pace is measured, for on a busy machine a simulated vehicle waits for
    its run, and lives slower than it says.
    """
    if question.speed is None:
        said = "says that it is something else" if question.told else f"did not say what it is within {SPEED_S:.0f} s"
        text = (
            f"`--speed {speed:g}` is for a vehicle that this program simulates, and this one {said}: at a real "
            "vehicle a second is a second"
        )
        return Refusal("not-simulated", text, "without `--speed`; `rtshcua sim --speed N` starts a simulated vehicle")
    if question.speed != hundredths(speed):
        text = f"the simulated vehicle flies {question.speed / 100:g} seconds in a second, and not {speed:g}"
        return Refusal("other-speed", text, f"`--speed {question.speed / 100:g}`")
    return None


def _expect_simulated(
    vehicle: ConnectedVehicle, clock: LinkClock, interrupts: Interrupts, speed: float, events: list[Event]
) -> None:
    question = SpeedQuestion()
    vehicle.driver.asks_first = question
    until_s = time.monotonic() + SPEED_S
    while not question.told and time.monotonic() < until_s:
        if interrupts.wish() is not None:
            raise Refused(ExitCode.INTERRUPTED, "interrupted", "interrupted before anything flew")
        events += vehicle.poll(clock.now().monotonic_us, clock.us_in(_POLL_S))
    vehicle.driver.asks_first = None
    refusal = unlike(question, speed)
    if refusal is not None:
        raise Refused(ExitCode.REFUSED, *refusal)


def meet(
    link: Address | None, system: int | None, vehicle: ConnectedVehicle, clock: LinkClock, interrupts: Interrupts,
    signing: Signing, *, hurried: bool, speed: float = 1,
) -> list[Event]:  # fmt: skip
    """Wait for the first heartbeat of an autopilot, and on a link of others for that of a second one, with which
    nothing begins; what happened meanwhile. The vehicle is ready only afterwards. `link` None: our own simulated
    vehicle. `hurried`: a flight may have broken off in the air; then a second vehicle is not waited for, so that the
    first is told to come down. `speed` other than 1: it is held to be simulated, which it has to say itself; else its
    times would not be checked, nor true in the log. Raises `Refused`.
    """
    events: list[Event] = []
    vehicle.driver.issued_from_us = _UNDATED_US
    until_s = time.monotonic() + HEARTBEAT_S
    while vehicle.driver.flavour is None:
        if interrupts.wish() is not None:
            raise Refused(ExitCode.INTERRUPTED, "interrupted", "interrupted before anything flew")
        if time.monotonic() > until_s:
            where = "the simulated vehicle" if link is None else f"a vehicle at `{link}`"
            raise Refused(ExitCode.LINK, *unmet(where, HEARTBEAT_S, system, signing.rejected, vehicle.silence))
        events += vehicle.poll(clock.now().monotonic_us, clock.us_in(_POLL_S))
    if link is not None and speed != 1:
        _expect_simulated(vehicle, clock, interrupts, speed, events)
    until_s = time.monotonic() + (0 if link is None or hurried else ANOTHER_S)
    while time.monotonic() < until_s and vehicle.driver.link.crowd is None:
        events += vehicle.poll(clock.now().monotonic_us, clock.us_in(_POLL_S))
    if vehicle.driver.link.crowd is not None:
        raise Refused(ExitCode.REFUSED, "two-vehicles", vehicle.driver.link.crowd, "one vehicle to a port is safest")
    vehicle.driver.issued_from_us = 0
    return events


def await_utc(
    utc: UtcWatch, vehicle: ConnectedVehicle, clock: LinkClock, issued_us: int, *, patient: bool,
    listens: bool = False, hurried: bool = False,
) -> list[Event]:  # fmt: skip
    """Take the vehicle's time of day where the kernel vouches for none; what happened meanwhile. The vehicle is ready
    only afterwards, and once it is certain that the mission was issued, at `issued_us` (UTC). `patient`: it is waited
    for, and then what the operator stated holds; else the vehicle is not ready before it told it. `listens`: the
    boundary listens, and an operator may have stated it there, so it is waited for as long, and where nobody did the
    vehicle is not ready either. `hurried`: a flight may have broken off, and what is armed then is brought down first.
    """
    events: list[Event] = []
    vehicle.driver.issued_from_us = _UNDATED_US
    until_s = time.monotonic() + (UTC_S if patient or listens else 0)
    while utc.waits and utc.vehicle_counts:
        flavour = vehicle.driver.flavour
        taken = flavour is not None and utc.look(vehicle.driver.source, flavour.name, clock.now().monotonic_us)
        if taken or time.monotonic() >= until_s or (hurried and vehicle.driver.seen.armed):
            break
        events += vehicle.poll(clock.now().monotonic_us, clock.us_in(_POLL_S))
    utc.settle()
    vehicle.driver.asks_utc = utc.vehicle_may_tell
    vehicle.driver.utc_patience_us = 0 if patient or (listens and not utc.waits) else clock.us_in(READY_UTC_S)
    vehicle.driver.issued_from_us = certain_from_us(issued_us, clock.now())
    return events
