"""Ask a vehicle what the one-minute policy needs: its home, and the height of its return. Nothing is set or moved."""

import time
from pathlib import Path
from typing import Final, NamedTuple

from rtshcua.adapters.clock import SystemClock
from rtshcua.adapters.doctor.examination import ExaminingDriver
from rtshcua.adapters.store.signing import LinkKeyError
from rtshcua.adapters.vehicle.address import Address, LinkCarrier
from rtshcua.adapters.vehicle.connected import ConnectedVehicle
from rtshcua.adapters.vehicle.transport import open_transport
from rtshcua.app.exit_codes import code_of
from rtshcua.app.fly.link_signing import LinkSigning
from rtshcua.app.gateway.configuration import VehicleSide
from rtshcua.app.gateway.relay_process import StartedRelay
from rtshcua.app.propose import Missions
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.exchange.stock_policy import GeoPoint
from rtshcua.onboard.enforcement.frames import FrameSession

#: how long to wait for the first heartbeat, then for its home, and then for its parameters, in seconds
_HEARTBEAT_S, _HOME_S, _PARAMETERS_S = 15.0, 20.0, 6.0
_POLL_S: Final = 0.05
#: parameters of the return height, and the mm in one unit of each
_RETURNS: Final = {"RTL_RETURN_ALT": 1_000, "RTL_ALT_M": 1_000, "RTL_ALT": 10}


class VehicleFacts(NamedTuple):
    """Where a vehicle is at home, the height of its return in mm above it (None: not reported), and the parameter of
    that height with the mm in one of its units.
    """

    home: GeoPoint
    return_mm: int | None
    return_name: str = ""
    return_unit_mm: int = 1


def examine(relay: StartedRelay, source: Path, side: VehicleSide, state: Path) -> VehicleFacts | Refusal:
    """Ask the vehicle behind a relay. `source` is a policy with the signals that a flight reads; `state` keeps the
    timestamps of a signed link. Raises OSError.
    """
    policy, clock, frames = Missions([source]).policy, SystemClock(), FrameSession()
    try:
        signing = LinkSigning(side.signing_key, policy, frames, state, clock, unsigned_radio=side.unsigned_radio)
    except LinkKeyError as error:
        return Refusal(f"link-key-{error.slug}", str(error), error.help or "", code_of(error.slug))
    driver = ExaminingDriver(policy, clock, frames, signing.verifier, side.system)
    link = relay.session()
    transport = open_transport(Address(LinkCarrier.INHERITED, "", link.detach()))
    vehicle = ConnectedVehicle(transport, driver, clock, lambda _utc_us, _frame: None)
    try:
        return _asked(vehicle, driver, clock)
    finally:
        vehicle.close()
        signing.close()


def _asked(vehicle: ConnectedVehicle, driver: ExaminingDriver, clock: SystemClock) -> VehicleFacts | Refusal:
    def wait(seconds: float, until: str) -> bool:
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            vehicle.poll(clock.now().monotonic_us, clock.us_in(_POLL_S))
            if _has(driver, until):
                return True
        return False

    if not wait(_HEARTBEAT_S, "heartbeat"):
        help = "check the address, and that nothing else uses the link; `rtshcua doctor --connect` examines it"
        return Refusal("link", "no vehicle answers", help, ExitCode.LINK)
    if not wait(_HOME_S, "home"):
        help = "wait until it has a position (3D fix), and start again; `rtshcua doctor` shows what it reports"
        return Refusal("no-home", "the vehicle does not report its home or its position", help, ExitCode.REFUSED)
    wait(_PARAMETERS_S, "return")
    message = driver.latest("HOME_POSITION")
    if message is not None:
        home = GeoPoint(message.latitude, message.longitude)
    else:
        message = driver.latest("GLOBAL_POSITION_INT")
        home = GeoPoint(message.lat, message.lon)
    name = _return_name(driver)
    if name is None or driver.parameters is None:
        return VehicleFacts(home, None)
    unit = _RETURNS[name]
    return VehicleFacts(home, round(driver.parameters.values[name] * unit), name, unit)


def _has(driver: ExaminingDriver, what: str) -> bool:
    """Whether the vehicle has reported this."""
    match what:
        case "heartbeat":
            return driver.flavour is not None
        case "home":
            position = driver.latest("GLOBAL_POSITION_INT")
            placed = position is not None and bool(position.lat or position.lon)
            return driver.latest("HOME_POSITION") is not None or placed
        case _:
            return _return_name(driver) is not None


def _return_name(driver: ExaminingDriver) -> str | None:
    """The parameter of the return height that the vehicle has."""
    known = {} if driver.parameters is None else driver.parameters.values
    return next((name for name in _RETURNS if name in known), None)
