"""The payload of a mission envelope: contract-bound invocations under one policy."""

from collections.abc import Iterator
from enum import IntEnum
from typing import ClassVar, Final

from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.struct import Extended, Flat

#: the heading of a point that is reached with the nose along the leg
ALONG: Final = -1
#: a full turn in 1/100 degree
TURN: Final = 36_000


class OnInadmissible(IntEnum):
    """What the mission does when a step is not admitted."""

    ABORT = 0
    HOLD = 1
    SKIP = 2
    REPLAN = 3  # as HOLD, and a replacement of the step is requested


class Plan(Extended, frozen=True):
    """Where the skill will take the vehicle, after the leg from its position at that time.

    `path` is x0, y0, x1, y1, ... in local mm; `altitude` in mm above home (for LAND and HOLD the height at
    dispatch is used instead), `speed` in mm/s, 0 where the vehicle chooses it.

    `heights` is the height of each point of the path, mm above home, of which `altitude` is an upper bound; empty if
    all are at the altitude. `headings` is the heading of the nose at each point, 1/100 degree clockwise from true
    north, or `ALONG`; empty if all are along.
    """

    LEAST: ClassVar[int] = 4

    kind: int
    path: tuple[int, ...]
    altitude: int
    speed: int
    heights: tuple[int, ...] = ()
    headings: tuple[int, ...] = ()

    def points(self) -> Iterator[tuple[int, int, int]]:
        """Each point of the path: x, y, and its height."""
        return points(self.path, self.heights, self.altitude)

    @property
    def last_height(self) -> int:
        """The height at the end of the path."""
        return self.heights[-1] if self.heights else self.altitude

    @property
    def lowest(self) -> int:
        """The least height on the path."""
        return min(self.heights, default=self.altitude)


def points(path: tuple[int, ...], heights: tuple[int, ...], altitude: int) -> Iterator[tuple[int, int, int]]:
    """Each point of a path: x, y, and its height, which is `altitude` without `heights`."""
    return zip(path[::2], path[1::2], heights or (altitude,) * (len(path) // 2), strict=True)


class Invocation(Flat, frozen=True):
    """The contract-bound invocation of section 2, `I = <sid, src, op, args, pre, ddl, vw, sc, auth, inv, f_b, ev>`.

    `contract` holds the whole contract of this step, with defaults resolved; `skill` is its index in the policy.
    `phases` is the bit set of mission phase indexes in which the invocation is valid. `issued_at_us` is UTC.
    `binding` is the digest over every other field, the policy's digest and version, the vehicle and the mission.
    """

    invocation_id: bytes
    step: int
    phase: int
    skill: int
    source: int
    role: int
    arguments: tuple[int, ...]
    issued_at_us: int
    phases: int
    on_inadmissible: int
    contract: Contract
    plan: Plan
    text: str
    file: int
    start: int
    end: int
    binding: bytes


class Mission(Flat, frozen=True):
    """A whole mission. `policy_digest` names the policy envelope's payload; `sources` are file names for spans."""

    name: str
    intent: str
    proposer: str
    vehicle: str
    policy: str
    policy_version: int
    policy_digest: bytes
    issued_at_us: int
    phases: tuple[str, ...]
    invocations: tuple[Invocation, ...]
    sources: tuple[str, ...]
    source_digests: tuple[bytes, ...]
