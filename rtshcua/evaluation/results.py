"""The raw results of the evaluation: one JSON object for each run, as a line of a file for each experiment.

All durations are integers in nanoseconds of the computer's clock. Where a mode is not available on this computer, one
`UnavailableMode` stands in place of its runs. A unit of work that failed leaves a `FailedAttempt`, and runs again.
"""

from typing import Annotated

import msgspec

#: a count, a size or a duration; a line with another number was not written by us
Natural = Annotated[int, msgspec.Meta(ge=0, le=1 << 53)]


class StepTiming(msgspec.Struct, frozen=True, kw_only=True):
    """One invocation of a flight: what was decided for the step, and how long it took.

    `end_to_end_ns` counts from the frame that released the step to its first command frame handed to the socket, with
    the evidence written between; `validation_ns` from request bytes to answer bytes of `enforce`; `dispatch_ns` from
    that answer to the frame. None where nothing was sent.
    """

    step: Natural
    outcome: str
    reason: str
    validation_ns: Natural
    end_to_end_ns: Natural | None
    dispatch_ns: Natural | None


class PointFlight(msgspec.Struct, frozen=True, kw_only=True, tag_field="result", tag="flight"):
    """X1, X2, X5: one flight. `proposal_ns` counts from the mission's text to its first command frame.

    `misses` counts invocations that were not dispatched by their deadline, `fallbacks` outcomes and dispatched links.
    `asked_again` counts answers about a step before its last one, which defer it; None: not counted.
    """

    mission: str
    deadline_us: Natural
    mode: str
    seed: Natural
    ending: str
    misses: Natural
    fallbacks: Natural
    proposal_ns: Natural
    invocations: tuple[StepTiming, ...]
    asked_again: Natural | None = None


class EnforceCheck(msgspec.Struct, frozen=True, kw_only=True, tag_field="result", tag="check"):
    """X3: one request through `enforce`.

    `as_expected`: outcome and reason are those of the table. `agrees`: outcome, reason, clause, target and end of
    validity are those of `decide`. `permits`: how many permits came with the answer. `differs`: both answers in words,
    where one of the two is not so.
    """

    case: str
    mission: str
    deadline_us: Natural
    mode: str
    repetition: Natural
    outcome: str
    reason: str
    as_expected: bool
    agrees: bool
    permits: Natural
    differs: str = ""


class CaseFlight(msgspec.Struct, frozen=True, kw_only=True, tag_field="result", tag="case-flight"):
    """X3, through the whole runtime in virtual time: one flight with the fault of a case.

    `expected` says in words what is to be dispatched, `dispatched` lists what was from the fault on. `differs` says
    what does not hold.
    """

    case: str
    mission: str
    deadline_us: Natural
    flavour: str
    seed: Natural
    aloft: bool
    expected: str
    dispatched: tuple[str, ...]
    ending: str
    holds: bool
    differs: str = ""


class FallbackTiming(msgspec.Struct, frozen=True, kw_only=True, tag_field="result", tag="fallback"):
    """X4: one triggered condition. `local_ns`: admission, selection of the fallback, and the record of evidence.

    `written_ns` is the same with the record written to its file, `synced_ns` with it on the disk.
    """

    case: str
    mode: str
    repetition: Natural
    local_ns: Natural
    written_ns: Natural
    synced_ns: Natural


class FallbackReaction(msgspec.Struct, frozen=True, kw_only=True, tag_field="result", tag="reaction"):
    """X4: one flight in which a condition strikes. `took_ns` counts from the telemetry frame that reveals it, or that
    releases the step that is refused, to the first frame of the fallback's command handed to the socket.
    """

    case: str
    mode: str
    repetition: Natural
    took_ns: Natural


class AppendTiming(msgspec.Struct, frozen=True, kw_only=True, tag_field="result", tag="append"):
    """X6: the appends of one log, by durability (`buffered`, `written`, `synced-first`), one duration a record.

    `octets` are those of these records. The first record of the log, which has the bundle, is not among them.
    """

    durability: str
    repetition: Natural
    octets: Natural
    appended_ns: tuple[Natural, ...]


class VerificationTiming(msgspec.Struct, frozen=True, kw_only=True, tag_field="result", tag="verification"):
    """X6: one verification of a log: `fast`, `default`, `audit-no-derive`, `audit`. `cold`: no verification before it
    in this process opened the bundle of the log, whose result is kept.
    """

    way: str
    records: Natural
    repetition: Natural
    took_ns: Natural
    cold: bool = False


class ComponentSize(msgspec.Struct, frozen=True, kw_only=True, tag_field="result", tag="component"):
    """X7: one component. `domain`: `companion` or `secure-world`; None where a size does not apply, in octets.

    `artifact` is the size of its sources or its ELF file, `memory` its peak while it flies the standard mission.
    """

    component: str
    domain: str
    files: tuple[str, ...]
    code_lines: Natural | None
    artifact: Natural | None
    memory: Natural | None
    state: str


class UnavailableMode(msgspec.Struct, frozen=True, kw_only=True, tag_field="result", tag="unavailable"):
    """A mode that this computer does not have, and why."""

    mode: str
    why: str


class FailedAttempt(msgspec.Struct, frozen=True, kw_only=True, tag_field="result", tag="failed"):
    """A unit of work that ended without results, and why."""

    why: str


Result = (
    PointFlight | EnforceCheck | CaseFlight | FallbackTiming | FallbackReaction | AppendTiming
    | VerificationTiming | ComponentSize | UnavailableMode | FailedAttempt
)  # fmt: skip
