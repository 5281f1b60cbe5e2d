"""What may be set of an autopilot before a flight, who permits it, and to what it is put back.

An operator names parameters and values when the flight is loaded; nothing is named otherwise. Of those that are named a
permit lists what the vehicle had and what it gets. To put something back, the value must be the one that a permit of
this session, or the record that an earlier run left, says it was before.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.parameters import shown, value_of
from rtshcua.wire.preparation import Preparation, decode, seal

#: how long a preparation permit may be used, in us: all of its parameters are asked for again several times
VALID_US: Final = 30_000_000

#: how many permits one session seals: what remembers which were used has a fixed size elsewhere
MOST_PERMITS: Final = 1_023

#: what may be set at all, and to what: bounds of the autopilot's own fence, what it does there (hold, return, land),
#: and the height of its return. Ranges are those of the parameter references of ArduCopter 4.7 and PX4 1.16.
SETTABLE: Final[Mapping[str, tuple[float, ...] | range]] = {
    "FENCE_ENABLE": (1.0,),
    "FENCE_TYPE": tuple(float(bits) for bits in range(16) if bits & 4),  # areas always: they carry the airspace
    "FENCE_RADIUS": range(30, 10_001),
    "FENCE_ALT_MAX": range(10, 1_001),
    "FENCE_ALT_MIN": range(-100, 101),
    "FENCE_MARGIN": range(1, 11),
    "RTL_ALT": range(30, 300_001),
    "RTL_ALT_M": range(1, 3_001),
    "GF_ACTION": (2.0, 3.0, 5.0),
    "GF_MAX_HOR_DIST": range(10_001),
    "GF_MAX_VER_DIST": range(10_001),
    "RTL_RETURN_ALT": range(1, 3_001),
}

# why nothing is permitted
MALFORMED: Final = Refusal("preparation/malformed", "what is asked for is no preparation")
NOT_CONFIGURED: Final = Refusal("preparation/not-configured", "a parameter, or its value, is not what was configured")
TOO_MANY: Final = Refusal("preparation/too-many", f"a session permits {MOST_PERMITS} preparations at most")
NOT_AS_BEFORE: Final = Refusal("preparation/not-as-before", "a value is not the one that the parameter had before")


def unsettable(name: str, bits: int) -> str | None:
    """Why a parameter is not set to this, in words; None where it may be, once it is configured."""
    accepted = SETTABLE.get(name)
    if accepted is None:
        return f"`{name}` is none of the parameters that are set for a flight: {', '.join(SETTABLE)}"
    value = value_of(bits)
    if isinstance(accepted, range):
        if accepted[0] <= value <= accepted[-1]:
            return None
        return f"`{name}` is set from {accepted[0]} to {accepted[-1]}, and not to {shown(bits)}"
    if value in accepted:
        return None
    words = ", ".join(f"{each:g}" for each in accepted)
    return f"`{name}` is set to {words}, and not to {shown(bits)}"


class Owed(NamedTuple):
    """What a parameter had before it was set for a flight, and what it was set to."""

    before: int
    value: int


class PreparationIssuer:
    """Seals preparation permits under the session key. `settings` is what was configured, by name;
    `owed`, what earlier runs left to be put back.
    """

    def __init__(
        self, key: bytes, settings: Mapping[str, int], owed: Mapping[str, Owed] = MappingProxyType({})
    ) -> None:
        #: what is set before the flight
        self.settings = dict(settings)
        self._key = key
        self._owed = dict(owed)
        self._serial = 0

    def owes(self, owed: Mapping[str, Owed]) -> None:
        """This is what earlier runs left to be put back."""
        self._owed = dict(owed)

    def permit(self, ask: bytes, now_us: int) -> bytes | Refusal:
        """The permit for what is asked for, at a monotonic time."""
        asked = decode(ask)
        if asked is None or not asked.writes or len({each.name for each in asked.writes}) < len(asked.writes):
            return MALFORMED
        if self._serial == MOST_PERMITS:
            return TOO_MANY
        refused = self._restoring(asked) if asked.restoring else self._setting(asked)
        if refused is not None:
            return refused
        self._serial += 1
        return seal(Preparation(self._serial, asked.restoring, now_us + VALID_US, asked.writes), self._key)

    def _restoring(self, asked: Preparation) -> Refusal | None:
        owed = self._owed
        for name, _, value in asked.writes:
            if name not in SETTABLE or name not in owed or owed[name].before != value:
                return NOT_AS_BEFORE
        return None

    def _setting(self, asked: Preparation) -> Refusal | None:
        """What was set already, and is set to something else, is put back to what it was before all that."""
        for name, _, value in asked.writes:
            if self.settings.get(name) != value or unsettable(name, value) is not None:
                return NOT_CONFIGURED
        for name, before, value in asked.writes:
            was = self._owed.get(name)
            first = before if was is None or was.value != before else was.before
            self._owed[name] = Owed(first, value)
        return None
