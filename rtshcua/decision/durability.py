"""How durable the record of a decision is to be before anyone acts on it; the auditor asks the same.

Only an `allow` of a mission's step waits for its record, for only that is something that was not there before. A
refusal moves nothing, and a link of a chain brings the vehicle home or down: what does so waits for no disk.

| decision | class |
|---|---|
| not `allow`; a link of a chain | written |
| `allow` of a step | what the contract records as, `synced` where it says nothing |
| `allow` of a step that needed an approval, or that climbs: it arms and takes off | synced first |

Of several the greatest counts.
"""

from functools import lru_cache
from typing import Final

from rtshcua.model.durability import SYNCED, SYNCED_FIRST, WORDS, WRITTEN
from rtshcua.model.flat.contract import Contract, MotionKind
from rtshcua.model.flat.situation import Context
from rtshcua.model.outcome import Outcome
from rtshcua.wire.request import STEP

#: where a contract says nothing
DEFAULT: Final = SYNCED

_CLASSES: Final = {word: number for number, word in enumerate(WORDS)}


def durability_of(contract: Contract, outcome: Outcome, *, confirmed: bool, kind: int) -> int:
    """The class, 0 to 3, of the record of a decision on this contract. `kind` is what asked: `wire.request.STEP`, or
    a link; `confirmed` says that somebody approved (`confirmed`).
    """
    if outcome is not Outcome.ALLOW or kind != STEP:
        return WRITTEN
    if confirmed or contract.motion.kind == MotionKind.CLIMB:
        return SYNCED_FIRST
    return recorded_as(contract.record)


def confirmed(context: Context) -> bool:
    """Whether somebody approved of what is decided on: no `confirm` rule that matches lets pass without.

    An approval that turned out not to be needed counts too, so that this derives from the record alone.
    """
    return any(approval.granted for approval in context.approvals)


@lru_cache(maxsize=256)
def recorded_as(record: tuple[str, ...]) -> int:
    """The class that a `record` clause asks for, without what risk adds."""
    return max((_CLASSES[word] for word in record if word in _CLASSES), default=DEFAULT)
