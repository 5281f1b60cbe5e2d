"""What is decided and why: the one form of it for the decision, the boundary, the log and the audit."""

from typing import TypeAlias

import msgspec

from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Link
from rtshcua.model.flat.policy import Airspace, Rule
from rtshcua.model.outcome import Outcome, Reason

#: what can decide; None where it is a field of the contract itself, or of the request
Decisive: TypeAlias = Clause | Rule | Airspace | None


class Decision(msgspec.Struct, frozen=True, gc=False):
    """What is decided, about a step or a link, and why.

    `step` is the number in design 4.1. `clause` decided, None where it was a field of the contract or the request.
    `target` is what flies on FALLBACK, `link` its index in the chain (`links.DEGRADE` for a degrade rule's); None when
    no link may fly, and for the other outcomes: a denied request must not steer the vehicle through its fallback. Where
    a link is asked for and may fly, it is the `target` of the ALLOW. `valid_until_us` (monotonic) bounds the permit of
    an ALLOW; for the others it is the moment of the decision. `consumed` is whether the step's id was used up before,
    as `Context` has it. `permit`, if not empty, is what the boundary grants by the decision.
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
