"""The ports of the onboard wing: what the pure runtime exchanges with the world, and who it expects on the other side.

Events come in, actions go out; `adapters` (a real link) and `simulation` in virtual time drive the same runtime. All
times are in us; `at_us` is monotonic.
"""

from collections.abc import Sequence
from enum import StrEnum
from typing import Final, NamedTuple, Protocol, dataclass_transform

import msgspec

from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.situation import Now
from rtshcua.wire.keys import SigningKey


@dataclass_transform(frozen_default=True)
class Frozen(msgspec.Struct, frozen=True):
    """The base of events, actions and commands: they do not change."""


# ---------------------------------------------------------------- events


class Event(Frozen, frozen=True):
    """Something that happened, and when."""

    at_us: int


class Readings(Event, frozen=True):
    """Signals that one frame carried: (state slot, canonical integer or None for "reported as not known").

    `at_us` is when the vehicle measured them, on our monotonic clock, as early as it may have been.
    """

    values: tuple[tuple[int, int | None], ...]


class Ready(Event, frozen=True):
    """The vehicle is connected, its estimator has a position and it would accept arming, or it flies already.

    `others`: it flies, and in a way that nothing of ours makes it fly (the name of a mode, `landing`, `another
    target`, or what an earlier run told).
    """

    others: str = ""


class VehicleUnfit(Event, frozen=True):
    """The vehicle will not be ready for this mission, however long it is waited for: `why`, in words."""

    why: str


class AirState(Event, frozen=True):
    """What the vehicle says of itself: armed, and in the air (EXTENDED_SYS_STATE, or the flavour's equivalent)."""

    armed: bool
    airborne: bool


class Sent(Event, frozen=True):
    """The first frame of command `token` went out at `at_us`: what admission and dispatch took is measured with it."""

    token: int


class Obeyed(Event, frozen=True):
    """The vehicle was seen to do command `token`, or another leg of it: its mode shows, and its target where it names
    one. What it was told before is in force no more.

    `target` is what it says that it flies to: latitude and longitude in 1e-7 degree, mm above mean sea level.
    """

    token: int
    target: tuple[int, int, int] | None = None


class Succeeded(Event, frozen=True):
    """The effect of command `token` was observed: arrived, climbed, landed and disarmed."""

    token: int


#: the reason of a `CommandFailed` command that was not sent because its record could not be kept
WITHHELD: Final = "withheld"


class CommandFailed(Event, frozen=True):
    """Command `token` was refused by the vehicle, or its effect did not come; or it was not sent (`late`, `withheld`).

    `text` is the vehicle's own, untrusted.
    """

    token: int
    reason: str
    text: str = ""


class Hindered(Event, frozen=True):
    """What keeps command `token` from getting on as it was told, in words; it decides nothing, but names a cause."""

    token: int
    text: str


#: what showed a takeover: it stands still far from its target, and nothing else tells who flies it
PAUSED: Final = "paused"


class TakenOver(Event, frozen=True):
    """Someone else flies the vehicle now: the pilot, a ground station, or the autopilot's own failsafe. They win.

    `how` says what showed it: the name of the mode, or another target, a landing or a disarming that nobody here
    commanded. `failsafe`: it said that its state is critical, so it is a failsafe of its own that flies it.
    """

    how: str
    failsafe: bool = False


class Crashed(Event, frozen=True):
    """The vehicle came down as no landing does. `how` says what showed it."""

    how: str


class LinkLost(Event, frozen=True):
    """Nothing came from the vehicle for longer than the link's limit; `heard_us` is when it was last heard.

    With 0 it was heard just now.
    """

    why: str = ""
    heard_us: int = 0


class LinkBack(Event, frozen=True):
    """The vehicle is heard again, and answers, after `LinkLost`. Its state is not fresh yet."""


class VehicleAnswers(Event, frozen=True):
    """Whether the vehicle answers, each time that this changes: one that is heard, and has answered nothing for longer
    than the link's limit, seems not to hear us. It may be silent meanwhile, too.
    """

    answers: bool


class Interrupted(Event, frozen=True):
    """The operator asked this program to stop (SIGINT, SIGTERM): fall back first, then end."""


class EvidenceFailed(Event, frozen=True):
    """The evidence sink cannot take records any more (disk full, I/O error), or not in time."""

    reason: str


class EvidenceKept(Event, frozen=True):
    """After `EvidenceFailed`, the sink took everything again. All that was given to it is written, and what
    was given up to the failure is on the disk.
    """


class ClockStepped(Event, frozen=True):
    """The machine's time of day was set, `by_us` ahead (or back). Records go on by the time of day they began with."""

    by_us: int


class StatusText(Event, frozen=True):
    """The vehicle said something to people (STATUSTEXT). `text` is its own, untrusted; `severity` is MAV_SEVERITY."""

    severity: int
    text: str


class Presented(Event, frozen=True):
    """Somebody handed over a signed document, as yet unverified: an approval, a recall, a replacement, a
    cancellation.

    `sender` numbers who gets the answer. `refused` is why it is refused, as a slug and a text, where that was found out
    before: then it is not looked at again. `envelope` is the document in base64, where that was made before.
    """

    document: bytes
    sender: int = 0
    refused: tuple[str, str] | None = None
    envelope: str = ""


class Anchored(Event, frozen=True):
    """A witness cosigned a checkpoint of the log; `note` is the checkpoint with its signature, which was verified."""

    note: str


class Noted(Event, frozen=True):
    """The vehicle's adapter found something that an operator should know; it decides nothing."""

    text: str


# ---------------------------------------------------------------- commands and actions


#: the `not_after_us` of what is never too late
ALWAYS: Final = (1 << 63) - 1


class Command(Frozen, frozen=True):
    """One bounded manoeuvre for the vehicle adapter, to be sent: the executor checked its permit in the same step.

    `kind` is a `MotionKind`. `path` is x0, y0, ... in local mm (east, north of declared home) with `geo` the same
    points as latitude, longitude in 1e-7 degree; `altitude` in mm above home, `speed` in mm/s (0: the vehicle's
    own default). A HOLD succeeds after `hold_us` of observed holding; with 0 it goes on until another command
    replaces it.

    `needs_record`: it is held until every `Append` before it is kept, and not sent when one cannot be written
    (`withheld`), or another command replaces it; a fallback goes out at once, and even then. Whoever sends it looks at
    the clock again: after `not_after_us` it is not sent, and `CommandFailed` with reason `late` says so.
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
    not_after_us: int = ALWAYS


class Ending(StrEnum):
    """How a mission run ended; each has its exit code in `diagnostics.exits`."""

    COMPLETED = "completed"  # all steps observed done, landed
    ABORTED = "aborted"  # a fallback or the contingency brought it down, or home
    REFUSED = "refused"  # nothing ever flew: refused on the ground
    RECALLED = "recalled"  # an operator called it back; it fell back first
    CANCELLED = "cancelled"  # who proposed it called it off; it fell back first
    STOOD_DOWN = "stood-down"  # the pilot or the autopilot took over
    CRASHED = "crashed"  # the vehicle came down as no landing does; nothing more is sent
    LINK_LOST = "link-lost"  # the vehicle went silent, or answered nothing
    INTERRUPTED = "interrupted"  # the operator stopped it; it fell back first
    EVIDENCE_LOST = "evidence-lost"  # nothing could be recorded any more


class Release(Frozen, frozen=True):
    """Stand down: send nothing more that moves the vehicle."""


class Append(Frozen, frozen=True):
    """Append one evidence line (with its newline), of a class of `model.durability`. Stands before every action that
    depends on it. A `Command` is held for those before it in its step that are `awaited`: for buffered ones not at
    all, for written and synced ones until they are written, for those that are synced first until they are on the disk.
    """

    line: bytes
    durability: int
    awaited: bool = True


class Announce(Frozen, frozen=True):
    """Tell any ground station, as STATUSTEXT; never needed for the flight, and the first to be left out."""

    severity: int
    text: str


class Expect(Frozen, frozen=True):
    """From now on these are the mission's steps: reports are to come as often as they need them."""

    steps: tuple[Invocation, ...]


class Reply(Frozen, frozen=True):
    """The answer to what `sender` presented: a stable slug, and a text for a person."""

    sender: int
    slug: str
    text: str


class End(Frozen, frozen=True):
    """The run is over."""

    ending: Ending


Action = Command | Release | Append | Announce | Expect | Reply | End


# ---------------------------------------------------------------- the other side


class BoundaryKey(NamedTuple):
    """What a boundary signs its evidence with (None: it has that itself), the number of its session (0: it does not
    know), and the digest that it kept of the one before; 32 zero octets where there was none.
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
        """Start the manoeuvre; a command under way is replaced. Its outcome comes as an event with its token."""
        ...

    def release(self) -> None:
        """Stand down: send nothing more that moves the vehicle."""
        ...

    def announce(self, severity: int, text: str) -> None:
        """Tell any ground station, as STATUSTEXT; left out when the link is busy."""
        ...

    def expect(self, steps: Sequence[Invocation]) -> None:
        """From now on these are the mission's steps: ask for reports as often as they need them."""
        ...


class EvidenceSink(Protocol):
    """Where evidence lines go, in their order. It takes them over and never makes the caller wait for the disk."""

    @property
    def kept(self) -> int:
        """How many lines, from the first on, are written: they survive the death of this process."""
        ...

    @property
    def synced(self) -> int:
        """How many lines, from the first on, are on the disk: they survive a loss of power."""
        ...

    def append(self, line: bytes, durability: int) -> int:
        """Take one line over, of a class of `model.durability`; it is written, or on the disk, once `kept`, or
        `synced`, reaches the number that is given back.

        Raises OSError when the line could not be written at once, or when more wait than may. It is not lost by that:
        the chain needs it, and it is written as soon as the disk takes it.
        """
        ...

    def trouble(self) -> str | None:
        """Why lines that were taken over are not kept, each failure told once; None while nothing went wrong."""
        ...

    def late(self) -> str | None:
        """That a line was not on the disk within the time promised for its class, told once; None while all are."""
        ...

    def close(self) -> None:
        """Flush and close. Waits for the disk, but not for ever."""
        ...


class MissionOpening(StrEnum):
    """What became of opening a mission on a vehicle."""

    OPENED = "opened"
    REPLAYED = "replayed"  # opened before, also by a run that crashed; or it might have been
    OLD_POLICY = "old-policy"  # a higher version of its policy was in force there
    DAMAGED = "damaged"  # what was kept about it is there, and says nothing: nobody knows
