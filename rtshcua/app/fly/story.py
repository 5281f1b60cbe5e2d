"""What the flying process tells the drawing one: JSON lines, each one of these."""

import msgspec

from rtshcua.onboard.runtime.view import RuntimeView


class LiveStep(msgspec.Struct, frozen=True):
    """A mission step as it was written, and the index of its phase."""

    text: str
    phase: int


class SignalFormat(msgspec.Struct, frozen=True):
    """How to write a signal's value: its dimension, and the labels of an enumeration."""

    name: str
    dimension: str
    labels: dict[int, str]


class Area(msgspec.Struct, frozen=True):
    """A zone on the map: rings of corners, x0, y0, x1, y1, ... in mm east and north of home. `kind` says what it is to
    the airspace: `inside` it must be stayed, `outside` it must be stayed, or neither (empty).
    """

    name: str
    kind: str
    rings: tuple[tuple[int, ...], ...]


class Asks(msgspec.Struct, frozen=True):
    """Whom a step waits for: a person of each of these roles, each with the command that answers as one, in words.

    It is awaited from the monotonic time `asked_us` until `until_us`. Without a socket nobody can answer: no commands.
    """

    roles: tuple[str, ...]
    asked_us: int
    until_us: int
    commands: tuple[tuple[str, ...], ...]


class FlightPlanView(msgspec.Struct, frozen=True, tag="plan", tag_field="event"):
    """What is going to fly. `position` names the signal that is one, `path` holds x, y in mm of every place gone to."""

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
    """How things stand now; one that cannot be sent at once is not sent."""

    view: RuntimeView


class Happening(msgspec.Struct, frozen=True, omit_defaults=True):
    """One record of the log, in brief: a decision (`event` is `decision`) or an effect. `t_us` is since the start.

    `waits` says of a deferral what it waits for, where that is to have been observed for long enough; `asks` which
    people. `role` is that of somebody who agreed.
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
    """A word about the run itself, not about the flight."""

    text: str


class Summary(msgspec.Struct, frozen=True, tag="summary", tag_field="event"):
    """How the run ended; also `summary.json` of the run folder. The log proves it, this only says it.

    `whole`: all evidence is on the disk, and the log was read back and verifies; else `missing` says what does not.
    `gaps_us`: for how long the log has nothing, for the computer stood still. `unconfirmed`: the fallbacks that were
    sent, and ended without a landing being seen. `may_fly`: that the vehicle may be flying, and why nothing watches it.
    `drain_declared`, `drain_measured`: what a minute takes of the charge at the worst, 1/10000, and `km_declared`,
    `km_measured` what a km over ground takes; 0 measured: it was not. `battery` says it in words.
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


Message = FlightPlanView | Snapshot | Happened | Note | Summary


def tenths(thousandths: int) -> str:
    """Thousandths as units with one decimal, never `-0.0`."""
    rounded = (abs(thousandths) + 50) // 100
    return f"{'-' if thousandths < 0 and rounded else ''}{rounded // 10}.{rounded % 10}"


def duration(us: int) -> str:
    """A time as a person reads it: `4 min 12 s`."""
    minutes, seconds = divmod(us // 1_000_000, 60)
    return f"{minutes} min {seconds} s" if minutes else f"{seconds} s"
