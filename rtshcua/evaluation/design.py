"""What the published evaluation varies: missions, deadlines, modes and repetitions."""

from typing import Final, NamedTuple

#: the missions
MISSIONS: Final = ("short", "standard", "extended")
#: how many steps each has
STEPS: Final = {"short": 3, "standard": 6, "extended": 12}
#: the deadlines of a step, in us from its release
DEADLINES_US: Final = (100_000, 200_000, 300_000, 500_000, 750_000, 1_000_000, 1_500_000)
#: `unenforced` takes only the steps timing, phase, state and safety of the decision; the others are modes of `run`
UNENFORCED: Final = "unenforced"
MODES: Final = ("none", UNENFORCED, "software", "process", "trustzone-m", "optee")
#: how often each cell is repeated
RUNS: Final = 30
#: what is run before it counts: rounds of all conditions of X4, and appends of X6 to another log
WARM_ROUNDS: Final = 20
WARM_APPENDS: Final = 200


class EvaluationPoint(NamedTuple):
    """A mission whose steps all have one deadline."""

    mission: str
    deadline_us: int


POINTS: Final = tuple(EvaluationPoint(mission, deadline_us) for mission in MISSIONS for deadline_us in DEADLINES_US)


class EvaluationPlan(NamedTuple):
    """What is asked for: how often each cell is repeated, in which modes; `quick`: a sample in two minutes."""

    runs: int = RUNS
    modes: tuple[str, ...] = MODES
    quick: bool = False


class WorkUnit(NamedTuple):
    """What one process runs at a time, and what is run again as a whole after an interruption.

    `experiment` is `X1` to `X7`; `key` identifies the unit in it (for X1: mission, deadline, seed and mode).
    """

    experiment: str
    key: tuple[str | int, ...]
