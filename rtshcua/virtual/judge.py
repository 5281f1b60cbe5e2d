"""An independent judge of a flight of a scenario: what went wrong, by what really was.

It reads where the simulated vehicle really was, and which frames of ours it really received. Of the runtime it uses no
code: zones are judged in floating point, frames are read by pymavlink. Only that the log verifies and that its decisions
are derived again is asked of the auditor, whose business that is; and what the log says is held against the frames.

| slug | is a failure |
|---|---|
| `outside-fence` | it was outside the policy's airspace. Zones that exist at times only are left out |
| `collision` | it flew into something, or came down too hard |
| `motion-after-takeover` | a frame that moves it was sent later than W (docs/adr/0034) after somebody took over |
| `not-ended` | at the end it neither rests on the ground nor stands still in the air |
| `late` | a frame that moves it came later than a bound allows: a permit's time, a reaction's |
| `log` | a log does not verify |
| `derive` | a decision of a log is not derived again |
| `unlogged-effect` | a frame that moves it, which the log has no command for |
| `fault` | an exception came out of the runtime, or the run did not end |

A failure that physics does not allow to prevent is an *exception* instead, with its `cause`: `excuse` has the causes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from rtshcua.virtual.flown import ScenarioFlown

SLUGS = (
    "outside-fence", "collision", "motion-after-takeover", "not-ended", "late", "log", "derive", "unlogged-effect",
    "fault",
)  # fmt: skip


class Failure(NamedTuple):
    """What went wrong, when (us of the simulation), and by how much, in mm or us, where that can be said.

    `cause` None: it should not have happened. Else it is an exception: that caused it, and nothing could be done.
    """

    slug: str
    at_us: int
    text: str
    amount: int = 0
    cause: str | None = None


@dataclass(frozen=True, slots=True)
class Margins:
    """How near it came to going wrong; None: there was nothing to come near to. Negative: by how much it went wrong."""

    fence_mm: int | None = None
    """How far inside the airspace it was when it was nearest to its edge."""
    obstacle_mm: int | None = None
    """How near it came to something that stands around."""
    stop_us: int | None = None
    """The longest time that a fallback took from what caused it to its first frame."""
    takeover_us: int | None = None
    """How long after a takeover the last frame that moves the vehicle was sent."""
    ended_us: int | None = None
    """How long the vehicle went on after the last process had ended."""


@dataclass(frozen=True, slots=True)
class Judgement:
    """What went wrong and should not have, what had to, and how near it was."""

    failures: tuple[Failure, ...]
    exceptions: tuple[Failure, ...]
    margins: Margins


def judge(flown: ScenarioFlown) -> Judgement:
    """What is to be said of a flight. Of each slug the first and the worst occurrence in each process are told."""
    found: Sequence[Failure] = ()
    return Judgement(tuple(found), (), Margins())
