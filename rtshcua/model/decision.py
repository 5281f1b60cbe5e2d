"""The result of a decision, in one form for the decision, the boundary, the log and the audit."""

from typing import TypeAlias

import msgspec

from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Link
from rtshcua.model.flat.policy import Airspace, Rule
from rtshcua.model.outcome import Outcome, Reason

#: the deciding clause; None where a field of the contract or of the request decided
Decisive: TypeAlias = Clause | Rule | Airspace | None


class Decision(msgspec.Struct, frozen=True, gc=False):
    """The decision about a step or a link, with its reason.

    `step` is the number in design 4.1. `clause` decided, None where a field of the contract or the request did.
    `target` is the link that flies on FALLBACK, `link` its index in the chain (`links.DEGRADE` for a degrade
    rule's). Both are None when no link may fly, and for the other outcomes: a denied request must not steer the
    vehicle through its fallback. In a decision about a link that may fly, it is the `target` of the ALLOW.
    `valid_until_us` (monotonic) limits the permit of an ALLOW; for the others it is the moment of the decision.
    `consumed` says whether the step's id was used before, as in `Context`. `permit`, if not empty, is the permit
    that the boundary issues.
    """

    outcome: Outcome
    reason: Reason
    step: int
    clause: Decisive
    link: int | None
    target: Link | None
    valid_until_us: int
    consumed: int = 0
    permit: bytes = b""
