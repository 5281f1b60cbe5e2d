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
}
#: however the mission was given up: nothing is left that could be sent
_TRIED: Final = (
    "the last link of the contingency was sent as often as it may be, and no landing was seen; this run may send "
    "nothing else, so it ends and stops watching"
)
OWN_FAILSAFE: Final = "its own failsafe flies it, so this run sends nothing more and stops watching"
#: for nothing else shows who it was
PAUSED: Final = (
    "it stands far from its target as if somebody had paused it, who may fly it on at any time, so this run sends "
    "nothing more and stops watching; if nobody did, nobody flies it: take it over"
)
RESTS: Final = "it says that it rests on the ground, and it obeyed a command and was not seen to land"


def may_fly(
    ending: Ending, last_seen: str, *, failsafe: bool = False, paused: bool = False, rests: bool = False
) -> str:
    """That the vehicle may be flying, where it was last seen, and why nothing watches it. `failsafe`: its own flies it.
    `paused`: that it stands is all that shows who flies it. `rests`: it says that it lies on the ground, disarmed.
    """
    if rests:
        return f"{RESTS}: approach it as one that may start"
    why = _WHY.get(ending, _TRIED)
    if ending is Ending.STOOD_DOWN and (failsafe or paused):
        why = OWN_FAILSAFE if failsafe else PAUSED
    return f"{last_seen}; the vehicle may be flying: {why}"
