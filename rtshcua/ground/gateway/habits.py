"""What a client is shown without an effect on the vehicle: an absorbed arming, a mode that it asked for, and parameters
that only give defaults.

Clients arm, or ask for GUIDED or OFFBOARD, before they send a take-off, and wait until HEARTBEAT shows it. The
vehicle's HEARTBEAT is then withheld from this client, and sent to it with the armed bit and the mode that it expects,
for a bounded time. A permitted take-off arms the vehicle.
"""

from math import isnan
from typing import Final

from rtshcua.ground.gateway.client_frames import Received
from rtshcua.ground.gateway.client_link import NOTICE, ClientLink
from rtshcua.ground.gateway.interface import Action, Withhold
from rtshcua.ground.gateway.vehicle_seen import VehicleSeen, parameter_name
from rtshcua.mavlink import enums, layouts
from rtshcua.mavlink.command_results import ACCEPTED, DENIED, TEMPORARILY_REJECTED
from rtshcua.mavlink.modes import PX4
from rtshcua.mavlink.parameters import decode, encode

#: how long an absorbed arming, or a mode without effect, is shown, us
SHOWN_US: Final = 20_000_000
_MOST_SHADOWS: Final = 32
#: how ArduPilot and PX4 begin the reason why they do not arm: several clients show no other texts
_REFUSED, _REFUSED_PX4 = "PreArm", "Arming denied"


class ShownState:
    """What one client is shown, and the withheld messages that follow from it."""

    def __init__(self, link: ClientLink, seen: VehicleSeen, actions: list[Action], autopilot: int) -> None:
        self._link = link
        self._refused = _REFUSED_PX4 if autopilot == PX4 else _REFUSED
        self._seen = seen
        self._actions = actions
        self._armed_until_us = 0
        self._mode: tuple[int, int | None, int] | None = None  # shown, the vehicle's own at that time, until when
        self._withheld: frozenset[int] = frozenset()
        #: messages that are withheld for another reason: those of its own mission
        self.of_mission: frozenset[int] = frozenset()

    def shows_armed(self, now_us: int) -> bool:
        """Whether an absorbed arming is shown."""
        return now_us < self._armed_until_us

    def shown_mode(self, now_us: int) -> int | None:
        """The mode that is shown in place of the vehicle's; None if that one is."""
        if self._mode is None:
            return None
        mode, before, until_us = self._mode
        return mode if now_us < until_us and self._seen.mode == before else None

    def arm(self, message: Received, now_us: int, hindrance: tuple[int, str] | None) -> int:
        """The answer to COMPONENT_ARM_DISARM. `hindrance`: why no take-off could follow an arming now, or what takes
        off in spite of a disarming, with the MAV_RESULT.
        """
        wanted, force = message.number("param1"), message.number("param2")
        if not isnan(force) and force != 0:
            self._link.text("forced arming and disarming are refused", now_us)
            self._link.record("refused", now_us, command="COMPONENT_ARM_DISARM", reason="forced")
            return DENIED
        if wanted == 1:
            return self._arm(now_us, hindrance)
        if wanted == 0:
            return self._disarm(now_us, hindrance)
        return DENIED

    def _arm(self, now_us: int, hindrance: tuple[int, str] | None) -> int:
        if hindrance is not None:
            result, reason = hindrance
            self._link.text(f"{self._refused}: {reason}", now_us)
            self._link.record("refused", now_us, command="COMPONENT_ARM_DISARM", reason=reason)
            return result
        if self._seen.armed:
            return ACCEPTED
        self._armed_until_us = now_us + SHOWN_US
        self._link.text("armed for you; a permitted take-off arms the vehicle", now_us, "armed", NOTICE)
        self._link.record("absorbed", now_us, command="COMPONENT_ARM_DISARM")
        self.update(now_us)
        return ACCEPTED

    def _disarm(self, now_us: int, hindrance: tuple[int, str] | None) -> int:
        if self._seen.armed:
            hindrance = TEMPORARILY_REJECTED, "land, then the vehicle disarms"
        self._armed_until_us = 0
        self.update(now_us)
        if hindrance is None:
            return ACCEPTED
        result, reason = hindrance
        self._link.text(f"disarming is refused: {reason}", now_us)
        self._link.record("refused", now_us, command="COMPONENT_ARM_DISARM", reason=reason)
        return result

    def show_mode(self, mode: int, now_us: int) -> None:
        """Show a mode that the client asked for, until the vehicle's changes, for a bounded time."""
        self._mode = mode, self._seen.mode, now_us + SHOWN_US
        self._link.record("absorbed", now_us, command="DO_SET_MODE", mode=mode)
        self.update(now_us)

    def update(self, now_us: int) -> None:
        """Withhold the messages that the gateway makes for this client, and no longer than that."""
        if self._seen.armed:
            self._armed_until_us = 0
        makes = self.shows_armed(now_us) or self.shown_mode(now_us) is not None
        withheld = self.of_mission | ({layouts.HEARTBEAT} if makes else set())
        if withheld == self._withheld:
            return
        began = layouts.HEARTBEAT in withheld - self._withheld
        self._withheld = withheld
        self._actions.append(Withhold(self._link.client, withheld))
        if began:
            self.heartbeat(now_us)

    def heartbeat(self, now_us: int) -> None:
        """Send the vehicle's last HEARTBEAT as this client is to see it, if it is withheld."""
        beat = self._seen.message(layouts.HEARTBEAT)
        if beat is None or layouts.HEARTBEAT not in self._withheld:
            return
        fields = dict(beat.fields)
        if self.shows_armed(now_us):
            fields["base_mode"] |= enums.MAV_MODE_FLAG_SAFETY_ARMED
        mode = self.shown_mode(now_us)
        if mode is not None:
            fields["custom_mode"] = mode
        self._link.send(layouts.HEARTBEAT, **fields)


def set_parameter(
    link: ClientLink, seen: VehicleSeen, message: Received, shadowed: frozenset[str], now_us: int, *, bytewise: bool
) -> bool:
    """Answer PARAM_SET: a shadowed parameter is kept for this client; any other one keeps its value, which is the
    answer of an autopilot that refuses. Return False for a parameter that was not seen yet: its value is the answer,
    once it is read.
    """
    name, kind = parameter_name(message), message.fields["param_type"]
    value = decode(message.fields["param_value"], kind, bytewise=bytewise)
    known = seen.parameters.get(name)
    if name in shadowed and len(link.shadows) < _MOST_SHADOWS:
        link.shadows[name] = value
        link.record("absorbed", now_us, parameter=name)
        echo = encode(value, kind, bytewise=bytewise)
        _tell_parameter(link, message, known, value if echo is None else echo)
        return True
    if known is not None:
        if known.fields["param_value"] != message.fields["param_value"]:
            link.text(f"parameter {name} stays as it is: writes are refused", now_us, f"parameter {name}")
            link.record("refused", now_us, parameter=name)
        _tell_parameter(link, known, known, known.fields["param_value"])
        return True
    link.text(f"parameter {name} is not set: writes are refused", now_us, f"parameter {name}")
    link.record("refused", now_us, parameter=name)
    return False


def tell_parameter(link: ClientLink, known: Received, *, bytewise: bool) -> None:
    """Send a parameter as it was seen, or as this client set it for itself."""
    value = known.fields["param_value"]
    shadow = link.shadows.get(parameter_name(known))
    own = None if shadow is None else encode(shadow, known.fields["param_type"], bytewise=bytewise)
    _tell_parameter(link, known, known, value if own is None else own)


def _tell_parameter(link: ClientLink, named: Received, known: Received | None, value: float) -> None:
    link.send(
        layouts.PARAM_VALUE,
        param_value=value,
        param_count=1 if known is None else known.fields["param_count"],
        param_index=0xFFFF if known is None else known.fields["param_index"],
        param_id=named.fields["param_id"],
        param_type=named.fields["param_type"],
    )
