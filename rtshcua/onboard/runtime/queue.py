"""`Q_onboard`, paper symbol: the mission's invocations, released one after the other, phase by phase."""

from rtshcua.model.flat.mission import Invocation, Mission


class InvocationQueue:
    """Where the mission stands: the current step, the phase it is in, and when that step was released.

    Release (section 4.3): for the first step the moment the vehicle is ready, later the end of the predecessor. Times
    are monotonic, in us.
    """

    def __init__(self, mission: Mission) -> None:
        self._steps = mission.invocations
        self._index = 0
        self._released_us: int | None = None

    @property
    def current(self) -> Invocation | None:
        """The step that is to be admitted or is running; None once all are done."""
        return self._steps[self._index] if self._index < len(self._steps) else None

    @property
    def at_last(self) -> bool:
        """Whether no step follows the current one."""
        return self._index + 1 >= len(self._steps)

    @property
    def released_us(self) -> int | None:
        """When the current step was released; None before the vehicle was ready."""
        return self._released_us

    @property
    def released(self) -> int:
        """How many steps were released; what they say does not change any more."""
        return 0 if self._released_us is None else min(self._index + 1, len(self._steps))

    @property
    def phase(self) -> int:
        """The index of the current mission phase; the last step's once all are done."""
        return self._steps[min(self._index, len(self._steps) - 1)].phase

    def release(self, now_us: int) -> None:
        """Release the first step. A later call changes nothing: a vehicle is ready once."""
        if self._released_us is None:
            self._released_us = now_us

    def replace(self, mission: Mission) -> None:
        """From now on these are the steps; those that were released are the same ones."""
        self._steps = mission.invocations

    def advance(self, now_us: int) -> None:
        """The current step ended, or is skipped: release the next."""
        self._index += 1
        self._released_us = now_us
