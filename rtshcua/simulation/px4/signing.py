"""How PX4 takes keys for signing (recent releases)."""

from rtshcua.codec.frames import Message
from rtshcua.simulation.autopilot import Autopilot


def on_setup_signing(a: Autopilot, message: Message) -> None:
    """SETUP_SIGNING."""
    a.signing.set_up(message, a.now_us)


def insists(a: Autopilot) -> bool:
    """MAV_SIGN_CFG: 0, the default, signs what it sends and takes what is not signed; 1 and 2 want signatures."""
    return a.parameters.value("MAV_SIGN_CFG") > 0
