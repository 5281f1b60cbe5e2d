"""How sensors and estimator come up, one after the other. Times are seconds from the start of the autopilot."""

from dataclasses import dataclass

_FAST_S = 1.0
"""All that a fast boot takes."""


@dataclass(frozen=True, slots=True)
class BootPlan:
    """When what is there, as recorded; a text is (time, severity, text); `{amsl}` is home's height."""

    answers_s: float
    """Sensors answer: SYS_STATUS, and a position if only of zeros."""
    standby_s: float
    """The heartbeat leaves `booting`."""
    booting: int
    """HEARTBEAT.system_status (MAV_STATE) up to then."""
    initialised_s: float
    attitude_s: float
    receiver_s: float
    """The receiver has a fix."""
    origin_s: float
    """There is a home, and with it a height above it."""
    checks_s: float
    """Nothing is inconsistent any more: without a position, the modes that need none can be armed in."""
    position_s: float
    """The estimator vouches for its position."""
    tells_early: bool
    """Whether GLOBAL_POSITION_INT comes before that: zeros, then what the receiver says."""
    texts: tuple[tuple[float, int, str], ...] = ()

    @property
    def pace(self) -> float:
        """How much faster than this a fast boot is."""
        return max(self.standby_s, self.checks_s, self.position_s) / _FAST_S
