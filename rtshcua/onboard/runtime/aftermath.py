"""What is said of the vehicle where a run ends, and it was not seen to land since a command of the run was sent."""

from collections.abc import Mapping
from typing import Final

from rtshcua.onboard.ports import Ending

#: the effect that says it in the log
MAY_FLY: Final = "may-fly"

#: why this run does not go on watching
_WHY: Mapping[Ending, str] = {
    Ending.STOOD_DOWN: "somebody else flies it, so this run sends nothing more and stops watching",
    Ending.LINK_LOST: "it is not heard or does not answer, so it can be neither watched nor told anything",
    Ending.ABORTED: "the last link of the contingency was sent as often as it may be, and no landing was seen",
    Ending.INTERRUPTED: "the operator ended this run, so nothing watches it any more",
}
_ENDS: Final = "this run is over, and nothing watches it any more"
OWN_FAILSAFE: Final = "its own failsafe flies it, so this run sends nothing more and stops watching"
RESTS: Final = "it says that it rests on the ground, and it obeyed a command and was not seen to land"


def may_fly(ending: Ending, last_seen: str, *, failsafe: bool = False, rests: bool = False) -> str:
    """That the vehicle may be flying, where it was last seen, and why nothing watches it. `failsafe`: its own flies it.
    `rests`: it says that it lies on the ground, disarmed.
    """
    if rests:
        return f"{RESTS}: approach it as one that may start"
    why = OWN_FAILSAFE if failsafe and ending is Ending.STOOD_DOWN else _WHY.get(ending, _ENDS)
    return f"{last_seen}; the vehicle may be flying: {why}"
