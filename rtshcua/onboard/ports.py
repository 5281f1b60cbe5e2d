"""The ports of the onboard software: what the pure runtime exchanges with its environment, and the interfaces of the
other side.

Events come in, actions go out; `adapters` (a real link) and `simulation` in virtual time drive the same runtime.
All times are in us; `at_us` is monotonic.
"""

from collections.abc import Sequence
from enum import StrEnum
from typing import Final, NamedTuple, Protocol, dataclass_transform

import msgspec

from rtshcua.model.flat.mission import ALONG, Invocation
from rtshcua.model.flat.situation import Now
from rtshcua.wire.keys import SigningKey


@dataclass_transform(frozen_default=True)
class Frozen(msgspec.Struct, frozen=True):
    """The immutable base of events, actions and commands."""


# ---------------------------------------------------------------- events


class Event(Frozen, frozen=True):
    """An event with its time."""

    at_us: int


class Readings(Event, frozen=True):
    """Signals in one frame: (state slot, canonical integer or None for "reported as unknown").

    `at_us` is the earliest time, on our monotonic clock, at which the vehicle may have measured them.
    """

    values: tuple[tuple[int, int | None], ...]


class Ready(Event, frozen=True):
    """The vehicle is connected, its estimator has a position and it would accept arming, or it flies already.

    `others`: it flies in a way that no command of ours explains (the name of a mode, `landing`, `another target`,
    or the report of an earlier run).
    """

    others: str = ""


class VehicleUnfit(Event, frozen=True):
    """The vehicle cannot become ready for this mission: `why`, as text."""

    why: str


class AirState(Event, frozen=True):
    """The vehicle's report that it is armed, and in the air (EXTENDED_SYS_STATE, or the equivalent)."""

    armed: bool
    airborne: bool


class Sent(Event, frozen=True):
    """The first frame of command `token` was sent at `at_us`; admission and dispatch time is measured with it."""

    token: int


class Obeyed(Event, frozen=True):
    """The vehicle was observed to carry out command `token`, or another leg of it: its mode matches, and its target
    if it reports one. No earlier command is in force any more.

    `target` is the reported target: latitude and longitude in 1e-7 degree, mm above mean sea level.
    """

    token: int
    target: tuple[int, int, int] | None = None


class Succeeded(Event, frozen=True):
    """The effect of command `token` was observed: arrived, climbed, landed and disarmed."""

    token: int


#: the reason of a `CommandFailed` for a command that was not sent because its record could not be stored
WITHHELD: Final = "withheld"


class CommandFailed(Event, frozen=True):
    """Command `token` was refused by the vehicle, or its effect was not observed; or it was not sent (`late`,
    `withheld`).

    `text` is the vehicle's own, untrusted.
    """

    token: int
    reason: str
    text: str = ""


class Hindered(Event, frozen=True):
    """What slows command `token` down, as text. It is recorded as a cause and decides nothing."""

    token: int
    text: str


class PayloadOutcome(Event, frozen=True):
    """A command to payload of command `token` was sent, had its effect (`done`), or did not (`failed`), as text."""

    token: int
    what: str
    text: str


#: how a takeover was detected: the vehicle stands still far from its target, and nothing else shows who flies it
PAUSED: Final = "paused"


class TakenOver(Event, frozen=True):
    """Somebody else flies the vehicle now: the pilot, a ground station, or the autopilot's own failsafe. They have
    priority.

    `how` is the evidence: the name of the mode, or another target, a landing or a disarming that this run did not
    command. `failsafe`: it reported a critical state, so its own failsafe flies it.
    """

    how: str
    failsafe: bool = False


class Crashed(Event, frozen=True):
    """The vehicle came down, but not by a landing. `how` is the evidence."""

    how: str


class LinkLost(Event, frozen=True):
    """The vehicle was silent for longer than the link's limit; `heard_us` is when it was last heard.

    0 means that it was heard just now.
    """

    why: str = ""
    heard_us: int = 0


class LinkBack(Event, frozen=True):
    """The vehicle is heard again and answers, after `LinkLost`. Its state is not fresh yet."""


class VehicleAnswers(Event, frozen=True):
    """Whether the vehicle answers, sent when that changes: a vehicle that is heard but has answered nothing for
    longer than the link's limit seems not to receive our frames. It may be silent meanwhile, too.
    """

    answers: bool


class Interrupted(Event, frozen=True):
    """The operator asked this program to stop (SIGINT, SIGTERM): fall back first, then end."""


class EvidenceFailed(Event, frozen=True):
    """The evidence sink cannot store records any more (disk full, I/O error), or not in time."""

    reason: str


class EvidenceKept(Event, frozen=True):
    """After `EvidenceFailed`, the sink works again. All records since are written, and those before the failure was
    reported are on the disk.
    """


class ClockStepped(Event, frozen=True):
    """The machine's time of day was set, `by_us` ahead (or back). Records continue with the original time of day."""

    by_us: int


class StatusText(Event, frozen=True):
    """A message of the vehicle for people (STATUSTEXT). `text` is its own, untrusted; `severity` is MAV_SEVERITY."""

    severity: int
    text: str


class ImageReported(Event, frozen=True):
    """A camera reported a picture for the first time. `detail` is its record (`evidence.image_records`), untrusted.
    `camera` is the MAVLink component, `index` None for a picture that failed.
    """

    camera: int
    index: int | None
    detail: str


class ImagesExpected(Event, frozen=True):
    """The indices from `first` to `last` that a camera's images of a series should have: those that are not recorded
    are missing.
    """

    camera: int
    series: int
    first: int
    last: int


class Presented(Event, frozen=True):
    """Somebody presented a signed document, not verified yet: an approval, a recall, a replacement, a cancellation.

    `sender` identifies who receives the answer. `refused` is the slug and text of a refusal that was found before;
    then it is not verified again. `envelope` is the document in base64, if it was encoded before.
    """

    document: bytes
    sender: int = 0
    refused: tuple[str, str] | None = None
    envelope: str = ""


class ClientRecord(Event, frozen=True):
    """What a gateway refused to one of its clients, or did in its place: a small JSON object, untrusted. It is recorded
    and decides nothing.
    """

    text: str


class Anchored(Event, frozen=True):
    """A witness cosigned a checkpoint of the log; `note` is the checkpoint with its signature, which was verified."""

    note: str


class Noted(Event, frozen=True):
    """A note of the vehicle's adapter for an operator; it decides nothing."""

    text: str


# ---------------------------------------------------------------- commands and actions


#: the `not_after_us` of a command without a time limit
ALWAYS: Final = (1 << 63) - 1


class PayloadFrame(Frozen, frozen=True):
    """A command to payload that a step sends while it flies (`model.flat.contract.Emission`), with its numbers.

    `numbers` are the bits of its seven parameters. If `height` is not None, the seventh is that height (mm above
    home) in metres above what the autopilot expects. It is sent at most `most` times, or if it has an interval as
    often as that allows; each time it may be repeated while nobody acknowledges it. `amount` is the distance in mm or
    the time in us between two.
    """

    command: int
    addressee: int
    numbers: tuple[int, ...]
    height: int | None
    moment: int
    amount: int
    most: int
    interval_us: int
    success: int
    bound: int
    within_us: int
    required: bool


class Command(Frozen, frozen=True):
    """One bounded manoeuvre for the vehicle adapter to send; the executor checked its permit in the same step.

    `kind` is a `MotionKind`. `path` is x0, y0, ... in local mm (east, north of declared home) with `geo` the same
    points as latitude, longitude in 1e-7 degree; `altitude` in mm above home, `speed` in mm/s (0: the vehicle's
    own default). `heights` (mm above home) and `headings` (1/100 degree, or `ALONG`) are those of the points of the
    path, as in a `Plan`. A HOLD succeeds after `hold_us` of observed holding; with 0 it continues until another command
    replaces it.

    `needs_record`: it is held until every earlier `Append` is stored, and not sent if one cannot be stored
    (`withheld`), or if another command replaces it. A fallback is sent at once in any case. The sender checks the
    clock again: after `not_after_us` the command is not sent, and `CommandFailed` with reason `late` reports it.

    `payload` is what a step sends to cameras, gimbals and the like meanwhile; `servos` are the vehicle's free outputs.
    """

    token: int
    skill: str
    kind: int
    path: tuple[int, ...]
    geo: tuple[int, ...]
    altitude: int
    speed: int
    hold_us: int = 0
    needs_record: bool = False
    heights: tuple[int, ...] = ()
    headings: tuple[int, ...] = ()
    not_after_us: int = ALWAYS
    payload: tuple[PayloadFrame, ...] = ()
    servos: tuple[int, ...] = ()

    def height_at(self, number: int) -> int:
        """The height of a point of the path, mm above home."""
        return self.heights[number] if self.heights else self.altitude

    def heading_at(self, number: int) -> int:
        """The heading of the nose at a point of the path, 1/100 degree, or `ALONG`."""
        return self.headings[number] if self.headings else ALONG


class Ending(StrEnum):
    """How a mission run ended; each has its exit code in `diagnostics.exits`."""

    COMPLETED = "completed"  # all steps completed, landed
    ABORTED = "aborted"  # a fallback or the contingency brought the vehicle down or home
    REFUSED = "refused"  # nothing flew: refused on the ground
    RECALLED = "recalled"  # recalled by an operator, after a fallback
    CANCELLED = "cancelled"  # cancelled by the proposer, after a fallback
    STOOD_DOWN = "stood-down"  # the pilot or the autopilot took over
    CRASHED = "crashed"  # the vehicle came down, but not by a landing; nothing more is sent
    LINK_LOST = "link-lost"  # the vehicle was silent, or answered nothing
    INTERRUPTED = "interrupted"  # stopped by the operator, after a fallback
    EVIDENCE_LOST = "evidence-lost"  # records could not be stored any more


class Release(Frozen, frozen=True):
    """Stand down: send nothing more that moves the vehicle."""


class Append(Frozen, frozen=True):
    """Append one evidence line (with its newline), of a class of `model.durability`, before every action that depends
    on it. A `Command` is held for earlier lines of its step that are `awaited`: not for buffered ones, for written
    and synced ones until they are written, for those that are synced first until they are on the disk.
    """

    line: bytes
    durability: int
    awaited: bool = True


class Announce(Frozen, frozen=True):
    """A text for all ground stations, as STATUSTEXT. The flight never needs it, and it is dropped first."""

    severity: int
    text: str


class Expect(Frozen, frozen=True):
    """Set the mission's steps: reports must come as often as these need them."""

    steps: tuple[Invocation, ...]


class Reply(Frozen, frozen=True):
    """The answer to the document of `sender`: a stable slug, and a text for a person."""

    sender: int
    slug: str
    text: str


class End(Frozen, frozen=True):
    """The run is over."""

    ending: Ending


Action = Command | Release | Append | Announce | Expect | Reply | End


# ---------------------------------------------------------------- the other side


class BoundaryKey(NamedTuple):
    """The key with which a boundary signs its evidence (None: it has its own), the number of its session (0:
    unknown), and the last digest of the previous session; 32 zero octets if there was none.
    """

    key: SigningKey | None
    session: int
    before: bytes


class Clock(Protocol):
    """The only source of time."""

    def now(self) -> Now:
        """Monotonic us, UTC us and the bound on its error."""
        ...


class Vehicle(Protocol):
    """A vehicle behind its adapter: telemetry becomes events, commands become frames."""

    def poll(self, now_us: int, timeout_us: int) -> Sequence[Event]:
        """Wait at most `timeout_us` for frames, and return what happened up to then."""
        ...

    def begin(self, command: Command, now_us: int) -> None:
        """Start the manoeuvre, replacing a command under way. The result comes as an event with its token."""
        ...

    def release(self) -> None:
        """Stand down: send nothing more that moves the vehicle."""
        ...

    def announce(self, severity: int, text: str) -> None:
        """Send a text to all ground stations, as STATUSTEXT; dropped when the link is busy."""
        ...

    def expect(self, steps: Sequence[Invocation]) -> None:
        """Set the mission's steps: request reports as often as they need them."""
        ...


class EvidenceSink(Protocol):
    """Stores evidence lines in order. It never makes the caller wait for the disk."""

    @property
    def kept(self) -> int:
        """How many lines, from the first on, are written: they survive the death of this process."""
        ...

    @property
    def synced(self) -> int:
        """How many lines, from the first on, are on the disk: they survive a loss of power."""
        ...

    def append(self, line: bytes, durability: int) -> int:
        """Accept one line, of a class of `model.durability`; it is written, or on the disk, once `kept`, or `synced`,
        reaches the returned number.

        Raises OSError if the line could not be written at once, or if too many lines wait. It is not lost then:
        the chain needs it, and it is written as soon as the disk accepts it.
        """
        ...

    def trouble(self) -> str | None:
        """Why accepted lines are not stored, once for each failure; None while there is no failure."""
        ...

    def late(self) -> str | None:
        """The report that a line was not on the disk within the time promised for its class, once; None if all were."""
        ...

    def close(self) -> None:
        """Flush and close. Waits for the disk, with a time limit."""
        ...


class MissionOpening(StrEnum):
    """The result of opening a mission on a vehicle."""

    OPENED = "opened"
    REPLAYED = "replayed"  # opened before, also by a run that crashed; or possibly opened
    OLD_POLICY = "old-policy"  # a higher version of its policy was in force before
    DAMAGED = "damaged"  # the stored state cannot be read, so the answer is unknown
