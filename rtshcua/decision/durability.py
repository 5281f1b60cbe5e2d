"""The durability class that the record of a decision needs before the decision may take effect. The auditor computes
the same.

Only the `allow` of a mission step waits for its record, because only that makes the vehicle do something new. A
refusal moves nothing, and a link of a chain brings the vehicle home or down, which must not wait for storage.

| decision | class |
|---|---|
| not `allow`; a link of a chain | written |
| `allow` of a step | the class in the contract, `synced` by default |
| `allow` of a step that needed an approval, or that climbs: it arms and takes off | synced first |

If several rows apply, the strictest class counts.
"""

from functools import lru_cache
from typing import Final

from rtshcua.model.durability import SYNCED, SYNCED_FIRST, WORDS, WRITTEN
from rtshcua.model.flat.contract import Contract, MotionKind
from rtshcua.model.flat.situation import Context
from rtshcua.model.outcome import Outcome
from rtshcua.wire.request import STEP

#: the default class of a contract
DEFAULT: Final = SYNCED

_CLASSES: Final = {word: number for number, word in enumerate(WORDS)}


def durability_of(contract: Contract, outcome: Outcome, *, confirmed: bool, kind: int) -> int:
    """The class, 0 to 3, of the record of a decision on this contract. `kind` is the kind of the request:
    `wire.request.STEP`, or a link. `confirmed` says that a person approved (see `confirmed`).
    """
    if outcome is not Outcome.ALLOW or kind != STEP:
        return WRITTEN
    if confirmed or contract.motion.kind == MotionKind.CLIMB:
        return SYNCED_FIRST
    return recorded_as(contract.record)


def confirmed(context: Context) -> bool:
    """Whether a person approved the decision, because a matching `confirm` rule lets nothing pass without an
    approval.

    An approval that was not needed counts too, so that the result derives from the record alone.
    """
    return any(approval.granted for approval in context.approvals)


@lru_cache(maxsize=256)
def recorded_as(record: tuple[str, ...]) -> int:
    """The class of the contract's `record` clause, without the additions for risk."""
    return max((_CLASSES[word] for word in record if word in _CLASSES), default=DEFAULT)
