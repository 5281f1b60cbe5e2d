"""The messages from the flying process to the drawing process, sent as JSON lines."""

import msgspec

from rtshcua.onboard.runtime.view import RuntimeView


class LiveStep(msgspec.Struct, frozen=True):
    """The source text of a mission step, and the index of its phase."""

    text: str
    phase: int


class SignalFormat(msgspec.Struct, frozen=True):
    """How to write a signal's value: its dimension, and the labels of an enumeration."""

    name: str
    dimension: str
    labels: dict[int, str]


class Area(msgspec.Struct, frozen=True):
    """A zone on the map: rings of corners, x0, y0, x1, y1, ... in mm east and north of home. `kind` is `inside` or
    `outside` if the vehicle must stay there, else empty.
    """

    name: str
    kind: str
    rings: tuple[tuple[int, ...], ...]


class Asks(msgspec.Struct, frozen=True):
    """A step waits for one person of each role, from `asked_us` until `until_us` (monotonic). `commands` has the
    arguments of the command that answers in each role; it is empty without a socket.
    """

    roles: tuple[str, ...]
    asked_us: int
    until_us: int
    commands: tuple[tuple[str, ...], ...]


class FlightPlanView(msgspec.Struct, frozen=True, tag="plan", tag_field="event"):
    """The plan of a flight. `position` names the position signal, `path` has x, y in mm of every target."""

    mission: str
    intent: str
    policy: str
    vehicle: str
    mode: str
    speed: float
    phases: tuple[str, ...]
    steps: tuple[LiveStep, ...]
    signals: tuple[SignalFormat, ...]
    position: str
    path: tuple[tuple[int, int], ...]
    areas: tuple[Area, ...] = ()


class Snapshot(msgspec.Struct, frozen=True, tag="view", tag_field="event"):
    """The present state; dropped if it cannot be sent at once."""

    view: RuntimeView


class Happening(msgspec.Struct, frozen=True, omit_defaults=True):
    """One record of the log, shortened: a decision (`event` is `decision`) or an effect. `t_us` counts from the start.

    For a deferral, `waits` says if a clause has not been observed for long enough, `asks` which people are awaited.
    `role` is the role of a person who agreed.
    """

    event: str
    t_us: int
    step: int = -1
    subject: str = ""
    outcome: str = ""
    reason: str = ""
    clause: str = ""
    target: str = ""
    detail: str = ""
    waits: str = ""
    role: str = ""
    asks: Asks | None = None


class Happened(msgspec.Struct, frozen=True, tag="happened", tag_field="event"):
    """A happening on its way to the view."""

    what: Happening


class Note(msgspec.Struct, frozen=True, tag="note", tag_field="event"):
    """A note about the run itself."""

    text: str


class Summary(msgspec.Struct, frozen=True, tag="summary", tag_field="event"):
    """The end of the run; also `summary.json` of the run folder. It is not signed; the log is the evidence.

    `whole`: all evidence is on the disk, and the log was read back and verified; else `missing` lists the defects.
    `gaps_us`: the time without records because the computer stood still. `unconfirmed`: the fallbacks that ended
    without an observed landing. `may_fly`: why the vehicle may still fly unwatched. `drain_*` is the charge used in the
    worst minute, `km_*` per km over ground, both in 1/10000; a measured 0 means not measured. `battery` is that as
    text. `images_*` are the images that cameras reported, those that are missing, and pictures that failed.
    `payload_failed` counts the commands to payload that failed, also those that no camera answered.
    """

    mission: str
    policy: str
    vehicle: str
    flavour: str
    mode: str
    ending: str
    exit_code: int
    steps: int
    steps_done: int
    outcomes: dict[str, int]
    flight_us: int
    records: int
    whole: bool
    folder: str
    log: str
    next: str
    missing: tuple[str, ...] = ()
    gaps_us: int = 0
    unconfirmed: tuple[str, ...] = ()
    may_fly: str = ""
    battery: tuple[str, ...] = ()
    drain_declared: int = 0
    drain_measured: int = 0
    km_declared: int = 0
    km_measured: int = 0
    images_taken: int = 0
    images_missing: int = 0
    images_failed: int = 0
    payload_failed: int = 0


Message = FlightPlanView | Snapshot | Happened | Note | Summary


def tenths(thousandths: int) -> str:
    """Format thousandths with one decimal, never as `-0.0`."""
    rounded = (abs(thousandths) + 50) // 100
    return f"{'-' if thousandths < 0 and rounded else ''}{rounded // 10}.{rounded % 10}"


def duration(us: int) -> str:
    """Format a duration as `4 min 12 s`."""
    minutes, seconds = divmod(us // 1_000_000, 60)
    return f"{minutes} min {seconds} s" if minutes else f"{seconds} s"
