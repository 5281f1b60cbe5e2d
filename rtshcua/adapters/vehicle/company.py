"""Other vehicles on the link: two autopilots that send to one port, of which one is flown, must not go unnoticed."""

from rtshcua.codec.frames import Codec
from rtshcua.mavlink.enums import MAV_AUTOPILOT_INVALID as NO_AUTOPILOT
from rtshcua.mavlink.enums import MAV_COMP_ID_AUTOPILOT1 as AUTOPILOT
from rtshcua.mavlink.signing import Verifier


class _AllBut:
    """Every system id but one; the Codec listens to no others."""

    def __init__(self, system: int) -> None:
        self._system = system

    def __contains__(self, system: object) -> bool:
        return system != self._system


class Company:
    """Hears out what is not the chosen vehicle's. With a `verifier` only what it accepts is anybody.

    `named`: the operator said which system is flown, so that others may speak too, but under no circumstances under
    the same id.
    """

    def __init__(self, system: int, verifier: Verifier | None, *, named: bool) -> None:
        self._system = system
        self._named = named
        self._others = Codec(0, 0, only=_AllBut(system), verifier=verifier)
        # with a key, a second sender of the vehicle's own frames is nobody: at most it repeats them
        self._anybody = Codec(0, 0) if verifier is None else self._others
        #: another vehicle, in words; None while there is none that matters
        self.found: str | None = None

    def hear(self, datagram: bytes, now_us: int, *, elsewhere: bool) -> None:
        """Take in a datagram; `elsewhere`: of another sender than the vehicle."""
        for frame in (self._anybody if elsewhere else self._others).parse(datagram, now_us):
            is_autopilot = frame.component == AUTOPILOT and frame.name == "HEARTBEAT"
            if not is_autopilot or frame.message.autopilot == NO_AUTOPILOT:
                continue
            if frame.system == self._system:
                self.found = f"two vehicles speak here as system {self._system}: give each an id of its own"
            elif not self._named and self.found is None:
                self.found = (
                    f"two vehicles speak here, systems {self._system} and {frame.system}: `--system` says which one "
                    "is meant"
                )
