"""How ArduCopter takes keys for signing."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Message
from rtshcua.simulation.autopilot import Autopilot


def on_setup_signing(a: Autopilot, message: Message) -> None:
    """SETUP_SIGNING: never while armed, as recorded; not even to switch it off."""
    if a.vehicle.armed:
        a.say(mavlink.MAV_SEVERITY_WARNING, "ERROR: Won't setup signing when armed")
    else:
        a.signing.set_up(message, a.now_us)


def insists(_: Autopilot) -> bool:
    """With a key, it always wants signatures."""
    return True
