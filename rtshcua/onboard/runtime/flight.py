"""What flies now, and where a chain of fallbacks stands."""

from enum import StrEnum

import msgspec

from rtshcua.model.flat.contract import Contract, Link, MotionKind
from rtshcua.onboard.ports import Command, Frozen
from rtshcua.wire.request import Ref


class Stage(StrEnum):
    """Where a run stands."""

    WAITING = "waiting"  # for the vehicle to be ready
    DECIDING = "deciding"  # about the current step; on the ground, or holding
    RUNNING = "running"  # the current step flies
    FALLING = "falling-back"  # a chain flies, down to the ground
    ENDED = "ended"


class Limits(Frozen):
    """How long the runtime waits for the world, in us.

    `ready_us` for a vehicle that is ready. `silent_us` for a lost link to come back: on the ground, or once somebody
    asked this program to stop; in the air that, and as long as the vehicle can fly. When the link is back, `fresh_us`
    for fresh state: longer than a link must be silent to count as lost, so that nothing is judged after one message and
    no more. A link that comes and goes is waited for `flapping_us` in all, from when it was back first.

    The last link of the contingency has nothing after it: it is tried `tries` times, `retry_us` apart. `again_us`
    bounds how long a deferred step is left without asking again when nothing was received.
    """

    ready_us: int = 120_000_000
    silent_us: int = 30_000_000
    fresh_us: int = 1_500_000
    flapping_us: int = 5_000_000
    retry_us: int = 2_000_000
    tries: int = 5
    again_us: int = 100_000


class Active(Frozen):
    """A command that was dispatched and has not ended; `ref` is what its permit is for. A link's time is over at
    `until_us`; a step has None.
    """

    ref: Ref
    command: Command
    since_us: int
    until_us: int | None

    @property
    def homeward(self) -> bool:
        """Whether its success is a landing."""
        return self.command.kind in (MotionKind.HOME, MotionKind.LAND)


class Chain(msgspec.Struct):
    """A chain that is being flown: its kind, the step it belongs to (-1: the contingency), and the last link used."""

    kind: int
    step: int
    after: int
    tried: int = 0
    wait_until_us: int = 0

    def ref(self, index: int) -> Ref:
        """The link of this index."""
        return Ref(self.kind, self.step, index)


def link_us(link: Link, contract: Contract, endurance_us: int) -> int:
    """How long a link may take: its own limit, else its skill's, else as long as anything can fly."""
    return link.limit_us or contract.duration_us or endurance_us
