"""The parameters of an autopilot that may be set before a flight, their permits, and their restoration.

An operator names parameters and values when the flight is loaded, and no others can be set. A permit lists some of
them with their previous and new values. A restored value must be the previous one according to a permit of this
session, or to the record of an earlier run.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.parameters import shown, value_of
from rtshcua.wire.preparation import Preparation, decode, seal

#: the validity of a preparation permit, in us: enough to read all of its parameters several times
VALID_US: Final = 30_000_000

#: the most permits of one session, because the record of used ones has a fixed size in the C boundary
MOST_PERMITS: Final = 1_023

#: the parameters that may be set, with their values: bounds of the autopilot's own fence, its reaction to a breach
#: (hold, return, land), and the height of its return. Ranges are those of the parameter references of ArduCopter 4.7
#: and PX4 1.16.
SETTABLE: Final[Mapping[str, tuple[float, ...] | range]] = {
    "FENCE_ENABLE": (1.0,),
    "FENCE_TYPE": tuple(
        float(bits) for bits in range(16) if bits & 4
    ),  # always including the areas, which contain the airspace
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

# reasons why a permit is refused
MALFORMED: Final = Refusal("preparation/malformed", "malformed preparation request")
NOT_CONFIGURED: Final = Refusal(
    "preparation/not-configured", "a parameter, or its value, differs from the configuration"
)
TOO_MANY: Final = Refusal("preparation/too-many", f"a session permits at most {MOST_PERMITS} preparations")
NOT_AS_BEFORE: Final = Refusal(
    "preparation/not-as-before", "a value differs from the one that the parameter had before"
)


def unsettable(name: str, bits: int) -> str | None:
    """Why a parameter may not be set to this value, as text; None if it may, once it is configured."""
    accepted = SETTABLE.get(name)
    if accepted is None:
        return f"`{name}` cannot be set for a flight; the parameters that can be are {', '.join(SETTABLE)}"
    value = value_of(bits)
    if isinstance(accepted, range):
        if accepted[0] <= value <= accepted[-1]:
            return None
        return f"`{name}` must be from {accepted[0]} to {accepted[-1]}, not {shown(bits)}"
    if value in accepted:
        return None
    words = ", ".join(f"{each:g}" for each in accepted)
    return f"`{name}` must be {words}, not {shown(bits)}"


class Owed(NamedTuple):
    """The value of a parameter before it was set for a flight, and the value that was set."""

    before: int
    value: int


class PreparationIssuer:
    """Seals preparation permits under the session key. `settings` is the configuration, by name; `owed`, the
    parameters that earlier runs left to be restored.
    """

    def __init__(
        self, key: bytes, settings: Mapping[str, int], owed: Mapping[str, Owed] = MappingProxyType({})
    ) -> None:
        #: the parameters to set before the flight
        self.settings = dict(settings)
        self._key = key
        self._owed = dict(owed)
        self._serial = 0

    def owes(self, owed: Mapping[str, Owed]) -> None:
        """Set the parameters that earlier runs left to be restored."""
        self._owed = dict(owed)

    def permit(self, ask: bytes, now_us: int) -> bytes | Refusal:
        """The permit for a request, at a monotonic time."""
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
        """A parameter that was set already and is set again is restored to its first value."""
        for name, _, value in asked.writes:
            if self.settings.get(name) != value or unsettable(name, value) is not None:
                return NOT_CONFIGURED
        for name, before, value in asked.writes:
            was = self._owed.get(name)
            first = before if was is None or was.value != before else was.before
            self._owed[name] = Owed(first, value)
        return None
