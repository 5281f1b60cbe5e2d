"""The ports of the onboard wing: what the pure runtime exchanges with the world, and who it expects on the other side.

Events come in, actions go out; `adapters` (a real link) and `simulation` in virtual time drive the same runtime. All
times are in us; `at_us` is monotonic.
"""

from collections.abc import Sequence
from enum import StrEnum
from typing import Final, Protocol

from rtshcua.model.flat.situation import Now
from rtshcua.onboard.frozen import Frozen as Frozen
from rtshcua.onboard.stores import EvidenceFailed as EvidenceFailed
from rtshcua.onboard.stores import EvidenceKept as EvidenceKept
from rtshcua.onboard.stores import EvidenceSink as EvidenceSink
from rtshcua.onboard.stores import Opening as Opening
from rtshcua.onboard.stores import ReplayStore as ReplayStore

# ---------------------------------------------------------------- events


class Readings(Frozen, frozen=True):
    """Signals that one frame carried: (state slot, canonical integer or None for "reported as not known").

    `at_us` is when the vehicle measured them, on our monotonic clock, as early as it may have been.
    """

    at_us: int
    values: tuple[tuple[int, int | None], ...]


class Ready(Frozen, frozen=True):
    """The vehicle is connected, its estimator has a position and it would accept arming, or it flies already.

    `others`: it flies, and in a way that nothing of ours makes it fly (the name of a mode, or `landing`).
    """

    at_us: int
    others: str = ""


class AirState(Frozen, frozen=True):
    """What the vehicle says of itself: armed, and in the air (EXTENDED_SYS_STATE, or the flavour's equivalent)."""

    at_us: int
    armed: bool
    airborne: bool


class Sent(Frozen, frozen=True):
    """The first frame of command `token` went out at `at_us`: what admission and dispatch took is measured with it."""

    at_us: int
    token: int


class Succeeded(Frozen, frozen=True):
    """The effect of command `token` was observed: arrived, climbed, landed and disarmed."""

    at_us: int
    token: int


#: the reason of a `Failed` command that was not sent because its record could not be kept
WITHHELD: Final = "withheld"


class Failed(Frozen, frozen=True):
    """Command `token` was refused by the vehicle, or its effect did not come; or it was not sent (`late`, `withheld`).

    `text` is the vehicle's own, untrusted.
    """

    at_us: int
    token: int
    reason: str
    text: str = ""


class TakenOver(Frozen, frozen=True):
    """Someone else flies the vehicle now: the pilot, a ground station, or the autopilot's own failsafe. They win.

    `how` says what showed it: the name of the mode, or another target, a landing or a disarming that nobody here
    commanded.
    """

    at_us: int
    how: str


class Crashed(Frozen, frozen=True):
    """The vehicle came down as no landing does. `how` says what showed it."""

    at_us: int
    how: str


class LinkLost(Frozen, frozen=True):
    """Nothing came from the vehicle for longer than the link's limit; `heard_us` is when it was last heard.

    With 0 it was heard just now.
    """

    at_us: int
    why: str = ""
    heard_us: int = 0


class LinkBack(Frozen, frozen=True):
    """The vehicle is heard again, and answers, after `LinkLost`. Its state is not fresh yet."""

    at_us: int


class Interrupted(Frozen, frozen=True):
    """The operator asked this program to stop (SIGINT, SIGTERM): fall back first, then end."""

    at_us: int


class ClockStepped(Frozen, frozen=True):
    """The machine's time of day was set, `by_us` ahead (or back). Records go on by the time of day they began with."""

    at_us: int
    by_us: int


class Said(Frozen, frozen=True):
    """The vehicle said something to people (STATUSTEXT). `text` is its own, untrusted; `severity` is MAV_SEVERITY."""

    at_us: int
    severity: int
    text: str


class Presented(Frozen, frozen=True):
    """Somebody handed over a signed document, as yet unverified: an approval, a recall, a replacement.

    `sender` numbers who gets the answer.
    """

    at_us: int
    document: bytes
    sender: int = 0


class Anchored(Frozen, frozen=True):
    """A witness cosigned a checkpoint of the log; `note` is the checkpoint with its signature, which was verified."""

    at_us: int
    note: str


class Noted(Frozen, frozen=True):
    """The vehicle's adapter found something that an operator should know; it decides nothing."""

    at_us: int
    text: str


Event = (
    Readings
    | Ready
    | AirState
    | Sent
    | Succeeded
    | Failed
    | TakenOver
    | Crashed
    | LinkLost
    | LinkBack
    | Interrupted
    | EvidenceFailed
    | EvidenceKept
    | ClockStepped
    | Said
    | Presented
    | Anchored
    | Noted
)


# ---------------------------------------------------------------- commands and actions


class Command(Frozen, frozen=True):
    """One bounded manoeuvre for the vehicle adapter; it exists only beside a permit.

    `kind` is a `MotionKind`. `path` is x0, y0, ... in local mm (east, north of declared home) with `geo` the same
    points as latitude, longitude in 1e-7 degree; `altitude` in mm above home, `speed` in mm/s (0: the vehicle's
    own default). A HOLD succeeds after `hold_us` of observed holding; with 0 it goes on until another command
    replaces it.
    """

    token: int
    skill: str
    kind: int
    path: tuple[int, ...]
    geo: tuple[int, ...]
    altitude: int
    speed: int
    hold_us: int = 0


class Ending(StrEnum):
    """How a mission run ended; each has its exit code in `diagnostics.exits`."""

    COMPLETED = "completed"  # all steps observed done, landed
    ABORTED = "aborted"  # a fallback or the contingency brought it down, or home
    REFUSED = "refused"  # nothing ever flew: refused on the ground
    RECALLED = "recalled"  # an operator called it back; it fell back first
    STOOD_DOWN = "stood-down"  # the pilot or the autopilot took over
    CRASHED = "crashed"  # the vehicle came down as no landing does; nothing more is sent
    LINK_LOST = "link-lost"  # the vehicle went silent
    INTERRUPTED = "interrupted"  # the operator stopped it; it fell back first
    EVIDENCE_LOST = "evidence-lost"  # nothing could be recorded any more


class Dispatch(Frozen, frozen=True):
    """Send `command`; the permit was checked by the executor in the same step.

    Whoever sends it looks at the clock again: after `not_after_us` it is not sent, and `Failed` with reason `late`
    says so. `needs_record`: it is held until every `Append` before it is kept, and not sent when one cannot be written
    (`withheld`), or another command replaces it; a fallback goes out at once, and even then.
    """

    command: Command
    not_after_us: int
    needs_record: bool


class Release(Frozen, frozen=True):
    """Stand down: send nothing more that moves the vehicle."""


class Append(Frozen, frozen=True):
    """Append one evidence line (with its newline), of a class of `evidence.durability`. Stands before every action that
    depends on it. A `Dispatch` is held for those before it in its step that are `awaited`: for buffered ones not at
    all, for written and synced ones until they are written, for those that are synced first until they are on the disk.
    """

    line: bytes
    durability: int
    awaited: bool = True


class Show(Frozen, frozen=True):
    """Something a person watching would like to know; never needed for the flight."""

    kind: str
    text: str
    step: int = -1


class Announce(Frozen, frozen=True):
    """Tell any ground station, as STATUSTEXT; never needed for the flight, and the first to be left out."""

    severity: int
    text: str


class Reply(Frozen, frozen=True):
    """The answer to what `sender` presented: a stable slug, and a text for a person."""

    sender: int
    slug: str
    text: str


class End(Frozen, frozen=True):
    """The run is over."""

    ending: Ending


Action = Dispatch | Release | Append | Show | Announce | Reply | End


class Boundary(Protocol):
    """The enforcement boundary after `load`: bytes in, bytes out, the same in process, isolated, or in another
    world.
    """

    def enforce(self, request: bytes) -> bytes:
        """Decide one request; the answer is a decision with, on `allow`, permits."""
        ...

    def consider(self, document: bytes, now: Now) -> None:
        """Look at a document ahead, in whatever thread; nothing comes of it but that `present` is quick."""
        ...

    def present(self, document: bytes, now: Now, released: int) -> bytes:
        """Take in a signed document, if it is to be trusted; the answer says what became of it.

        `released` is the number of steps that were released: none of them is replaced any more.
        """
        ...


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
