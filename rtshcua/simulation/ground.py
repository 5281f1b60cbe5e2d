"""The vehicle on the ground: its motors run up, it notices that it has landed, it disarms when nothing happens."""

from rtshcua.simulation.handling import Handling


class Ground:
    """What takes time on the ground, in seconds."""

    def __init__(self, handling: Handling) -> None:
        self._handling = handling
        self._for_s = 0.0
        self._lifting_s: float | None = None
        self._has_flown = False

    def arm(self) -> None:
        """The motors start."""
        self._for_s = 0.0
        self._has_flown = False
        self._lifting_s = None

    def touch(self) -> None:
        """It came down."""
        self._for_s = 0.0

    def run_up(self) -> None:
        """It is to lift off; motors that run up already go on."""
        if self._lifting_s is None:
            agility = self._handling.agility
            self._lifting_s = max(agility.spool_s - self._for_s, 0.0) + agility.ramp_s

    def stay(self) -> None:
        """It is not to lift off any more."""
        self._lifting_s = None

    @property
    def lifting(self) -> bool:
        """Whether it is to lift off."""
        return self._lifting_s is not None

    def lifts_off(self, dt: float) -> bool:
        """Lets `dt` seconds pass while it is to lift off; whether the motors carry it now."""
        self._for_s += dt
        if self._lifting_s is None:
            return False
        self._lifting_s -= dt
        if self._lifting_s > 0:
            return False
        self._lifting_s = None
        self._has_flown = True
        return True

    def has_landed(self, dt: float) -> bool:
        """Lets `dt` seconds pass after it came down; whether it knows now."""
        self._for_s += dt
        if self._for_s < self._handling.agility.land_detect_s:
            return False
        self._for_s = 0.0
        return True

    def has_lain(self, dt: float, seconds: float) -> bool:
        """Lets `dt` seconds pass after a crash; whether so many have."""
        self._for_s += dt
        return self._for_s >= seconds

    def has_done(self, dt: float, landing: bool) -> bool:
        """Lets `dt` seconds pass while it stands armed; whether it is to disarm, sooner after a flight or `landing`."""
        self._for_s += dt
        handling = self._handling
        return self._for_s >= (handling.landed_disarm_s if self._has_flown or landing else handling.idle_disarm_s)
