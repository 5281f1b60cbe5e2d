"""The data of a run for display: plain values, made on request, without access to the runtime."""

from enum import StrEnum

from rtshcua.onboard.ports import Ending, Frozen


class RunStage(StrEnum):
    """The stage of a run."""

    WAITING = "waiting"  # waits for the vehicle to be ready
    DECIDING = "deciding"  # waits for the current step; on the ground, or holding
    RUNNING = "running"  # the current step flies
    FALLING = "falling-back"  # a chain flies, down to the ground
    ENDED = "ended"


class SignalReading(Frozen):
    """A signal's canonical value (None: unknown, a position has two), its age in us, and whether it is stale."""

    name: str
    values: tuple[int | None, ...]
    age_us: int
    stale: bool


class Decided(Frozen):
    """One recorded decision, as text."""

    at_us: int
    subject: str
    outcome: str
    reason: str
    clause: str


class RuntimeView(Frozen):
    """A snapshot at a monotonic time.

    `contract` names the skill that flies or is being decided; `left_us` counts down to its deadline while
    deciding, to its time limit while it flies, None if there is none. `step` counts from 0 and is `steps` once all
    are done.
    """

    at_us: int
    stage: RunStage
    phase: str
    step: int
    steps: int
    contract: str
    left_us: int | None
    armed: bool | None
    airborne: bool | None
    linked: bool
    signals: tuple[SignalReading, ...]
    decisions: tuple[Decided, ...]
    ending: Ending | None
