"""What the paper publishes of its evaluation, as data, and what it leaves open.

Each figure has its origin: stated in the paper, or derived from stated figures. The paper publishes no value for a
single deadline. Its modes are `none`, `software` and `optee`.
"""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final, NamedTuple

from rtshcua.evaluation.design import WARM_APPENDS, WARM_ROUNDS


class Origin(StrEnum):
    """Where a figure comes from; the value is the mark that the report prints."""

    PUBLISHED = "P"
    DERIVED = "D"


class PublishedFigure(NamedTuple):
    """A figure, or a range of them from `low` to `high`; `unit` is that of the paper, "" for a count."""

    experiment: str
    quantity: str
    low: float
    high: float
    unit: str
    origin: Origin

    @property
    def text(self) -> str:
        """The figure as the paper writes it, without its unit."""
        ends = [f"{end:,}" for end in (self.low, self.high)]
        return ends[0] if self.low == self.high else f"{ends[0]} to {ends[1]}"


#: the modes of the paper
PUBLISHED_MODES: Final = ("none", "software", "optee")

_P95_MS: Final = {
    "short": (56.5, 55.7, 231.6),
    "standard": (89.9, 90.4, 265.9),
    "extended": (134.9, 135.0, 308.0),
}
_MEDIAN_MS: Final = {"short": (24.0, 24.4, 197.7), "standard": (24.0, 24.0, 197.5), "extended": (26.8, 27.2, 201.3)}
_VALIDATION_MS: Final = ((0.073, 0.074), (0.318, 0.322), (180.7, 185.4))
#: less software, from the two tables above: median and P95 of each mission
_DERIVED_MS: Final = {"short": (173.3, 175.9), "standard": (173.5, 175.5), "extended": (174.1, 173.0)}
#: (key, experiment, quantity, low, high, unit, origin)
_OTHERS: Final = (
    ("x1/runs", "X1", "flights", 1890, 1890, "", "P"),
    ("x1/repetitions", "X1", "flights of a cell", 30, 30, "", "P"),
    ("x1/cells", "X1", "cells: missions by deadlines by modes", 63, 63, "", "P"),
    ("x1/points", "X1", "points: missions by deadlines", 21, 21, "", "P"),
    ("x1/misses", "X1", "flights with a missed deadline", 0, 0, "", "P"),
    ("x1/fallbacks", "X1", "flights with a fallback", 0, 0, "", "P"),
    ("x1/software-adds", "X1", "P95 that software adds to none, less than", 1, 1, "ms", "P"),
    ("x3/cases", "X3", "cases", 12, 12, "", "P"),
    ("x3/checks", "X3", "checks, all equal", 7560, 7560, "", "P"),
    ("x3/repetitions", "X3", "checks of a case and point", 30, 30, "", "P"),
    ("x4/median", "X4", "median of a condition", 0.132, 0.143, "ms", "P"),
    ("x4/p95", "X4", "P95 of every condition, below", 0.149, 0.149, "ms", "P"),
    ("x4/repetitions", "X4", "runs of a condition", 30, 30, "", "P"),
    ("x5/validation-median", "X5", "added median validation, mean over points", 172.8, 172.8, "ms", "P"),
    ("x5/validation-range", "X5", "added median validation, all points", 171.1, 174.5, "ms", "P"),
    ("x5/end-to-end-median", "X5", "added median end-to-end, mean over points", 173.6, 173.6, "ms", "P"),
    ("x5/end-to-end-p95", "X5", "added P95 end-to-end, mean over points", 174.8, 174.8, "ms", "P"),
    ("x5/derived-median", "X5", "added median end-to-end, mean of the three missions", 173.6, 173.6, "ms", "D"),
    ("x5/derived-p95", "X5", "added P95 end-to-end, mean of the three missions", 174.8, 174.8, "ms", "D"),
    ("x6/records", "X6", "records of the log", 1000, 1000, "", "P"),
    ("x6/append-median", "X6", "append, median", 40.75, 40.75, "us", "P"),
    ("x6/append-p95", "X6", "append, P95", 56.46, 56.46, "us", "P"),
    ("x6/append-p99", "X6", "append, P99", 152.88, 152.88, "us", "P"),
    ("x6/verification", "X6", "offline verification of a record", 13.96, 13.96, "us", "P"),
    ("x6/throughput", "X6", "verified records in a second", 71_600, 71_600, "", "P"),
    ("x6/throughput-derived", "X6", "verified records in a second, from the time of a record", 71_630, 71_630, "", "D"),
    ("x6/octets", "X6", "mean record", 545, 545, "bytes", "P"),
    ("x7/lines-summed", "X7", "sum of the rows, code lines", 1296, 1296, "", "D"),
    ("x7/memory-summed", "X7", "sum of the rows, peak memory", 537.84, 537.84, "KB", "D"),
    ("x7/artifact-summed", "X7", "sum of the rows, artifact", 173.44, 173.44, "KB", "D"),
    ("x7/artifact-shared", "X7", "sum of the rows, artifact, 8.29 KB once", 165.15, 165.15, "KB", "D"),
    ("x7/artifact-unexplained", "X7", "further artifact that is shared", 8.72, 8.72, "KB", "D"),
)


def _figures() -> dict[str, PublishedFigure]:
    """All figures by their key."""
    made: dict[str, PublishedFigure] = {}
    stated, derived = Origin.PUBLISHED, Origin.DERIVED
    for number, mode in enumerate(PUBLISHED_MODES):
        for mission in _P95_MS:
            p95, median = _P95_MS[mission][number], _MEDIAN_MS[mission][number]
            name = f"{mission}/{mode}"
            made[f"x1/p95/{name}"] = PublishedFigure("X1", f"P95 end-to-end, {name}", p95, p95, "ms", stated)
            made[f"x2/median/{name}"] = PublishedFigure(
                "X2", f"median end-to-end, {name}", median, median, "ms", stated
            )
        low, high = _VALIDATION_MS[number]
        made[f"x2/validation/{mode}"] = PublishedFigure("X2", f"P95 validation, {mode}", low, high, "ms", stated)
    for mission, (median, p95) in _DERIVED_MS.items():
        made[f"x5/median/{mission}"] = PublishedFigure(
            "X5", f"added median end-to-end, {mission}", median, median, "ms", derived
        )
        made[f"x5/p95/{mission}"] = PublishedFigure("X5", f"added P95 end-to-end, {mission}", p95, p95, "ms", derived)
    for key, experiment, quantity, low, high, unit, origin in _OTHERS:
        made[key] = PublishedFigure(experiment, quantity, low, high, unit, Origin(origin))
    return made


FIGURES: Final[Mapping[str, PublishedFigure]] = _figures()


class PublishedComponent(NamedTuple):
    """A row of the published footprint: code lines, artifact and peak memory in KB (of 1,000 or 1,024 bytes)."""

    component: str
    domain: str
    code_lines: int
    artifact_kb: float
    memory_kb: float
    state: str


FOOTPRINT: Final = (
    PublishedComponent("runtime dispatcher", "companion", 134, 8.29, 4.76, "-"),
    PublishedComponent("invocation queue", "companion", 23, 8.29, 16.32, "queue state"),
    PublishedComponent("state monitor", "companion", 102, 12.38, 10.05, "vehicle-state snapshot"),
    PublishedComponent("skill executor", "companion", 127, 10.50, 0.31, "-"),
    PublishedComponent("enforcement client", "companion", 215, 11.80, 12.06, "policy cache"),
    PublishedComponent("evidence logger", "companion", 53, 2.63, 184.24, "evidence chain"),
    PublishedComponent("trusted enforcement TA", "secure-world", 642, 119.55, 310.10, "keys, nonces, chain"),
)
#: as printed; its rows have other sums (`x7/lines-summed` and following)
FOOTPRINT_TOTAL: Final = PublishedComponent("total as printed", "", 1292, 156.43, 488.52, "")

#: the computer of the published figures: (part, value)
PLATFORM: Final = (
    ("processor", "Intel Xeon Platinum 8558, 48 cores at 2.1 GHz"),
    ("memory", "256 GB DDR5-4800"),
    ("disk", "Samsung 990 EVO Plus 2 TB"),
    ("system", "Ubuntu 24.04 LTS, Linux 6.8.x"),
    ("tools", "GCC/G++ 13.x, CMake, Ninja, Python 3.12.x"),
    ("agent", "OpenClaw; Qwen-Max at temperature 0"),
    ("vehicle", "PX4 SITL v1.16.0, Gazebo Harmonic LTS, MAVSDK-Python 3.15.3, MAVLink v2"),
    ("trusted part", "OP-TEE in QEMU: the OP-TEE column is of emulated hardware"),
)


#: what the paper defines: (symbol or term, meaning)
DEFINITIONS: Final = (
    ("I", "an invocation: `<sid, src, op, args, pre, ddl, vw, sc, auth, inv, f_b, ev>`"),
    ("T", "its times `<t_g, t_r, ddl, vw, cls>`: generation, receipt on board, deadline, validity window, class"),
    (
        "class",
        "semantic: seconds or longer; tactical: from below a second to a second; reflex: without an agent in the loop",
    ),
    ("valid", "`valid_T`, deadline and window against the time `t`, and `valid_S`, the state clauses against `S_t`"),
    ("L_rem", "`L_val + L_disp` for what is queued on board; otherwise `L_src + L_comp + L_val + L_disp`"),
    ("admissible", "`valid_T and valid_S and L_rem <= ddl - t`"),
    ("eta(I, S_t, P)", "the outcome: allow, deny, defer or fallback"),
    (
        "binding",
        "in the model `H(sid, op, args, auth, ddl, vw, P_ver)`, in the prototype `H(sid, src, op, args, ddl, vw, auth, "
        "inv, P_ver)`; neither covers `pre`, `sc`, `f_b` and `ev`",
    ),
    ("evidence", "`<h_intent, h_agent, I, S_t, P_ver, r_eta, r_time, B, f_b, act>`"),
    ("fallback actions", "hover or local hold, `return_home`, `emergency_land`, confirmation by a user"),
    ("deadline", "0.1 to 1.5 s; bounds the admission and dispatch of a skill, never a control loop"),
    ("cell-averaged P95", "the mean over the seven deadline cells of a mission and mode; whiskers: least and greatest"),
)


class PublishedCase(NamedTuple):
    """A case of X3: what strikes the request, and the outcome and reason that must follow.

    `named` says whether the paper names the case; `extra` whether it is counted apart from the twelve.
    """

    number: int
    name: str
    perturbation: str
    outcome: str
    reason: str
    named: bool = False
    extra: bool = False


CASES: Final = (
    PublishedCase(1, "normal allow", "none", "allow", "admitted", named=True),
    PublishedCase(2, "expired slack", "the deadline has passed", "fallback", "timing/no-slack", named=True),
    PublishedCase(3, "low battery", "30 % of charge, 35 % required", "fallback", "state/violated"),
    PublishedCase(4, "degraded link", "10 % of link quality, 40 % required", "fallback", "state/violated"),
    PublishedCase(5, "obstacle near", "an obstacle at 2 m, under the clearance", "fallback", "state/violated"),
    PublishedCase(6, "wind over limit", "12 m/s of wind, at most 10 permitted", "fallback", "state/violated"),
    PublishedCase(7, "GPS missing", "the GPS fix is unknown", "defer", "state/unknown", named=True),
    PublishedCase(8, "stale state", "a position older than its `stale after`", "defer", "safety/unknown"),
    PublishedCase(9, "skill not permitted", "no permit covers it", "deny", "authority/not-permitted", named=True),
    PublishedCase(10, "argument out of scope", "40 m of altitude, 30 permitted", "deny", "authority/out-of-scope"),
    PublishedCase(11, "binding tampered", "one bit of the binding differs", "deny", "integrity/binding-mismatch"),
    PublishedCase(12, "replay", "the id was used before", "deny", "freshness/replayed", named=True),
    PublishedCase(
        13,
        "policy version mismatch",
        "bound to another version",
        "deny",
        "integrity/binding-mismatch",
        extra=True,
    ),
    PublishedCase(14, "validity over", "later than issue and validity", "deny", "freshness/expired", extra=True),
)


class OpenChoice(NamedTuple):
    """What the paper leaves open, and what is measured here instead. `anchor` is unique."""

    anchor: str
    experiments: str
    open: str
    ours: str


#: the largest ratio of two medians that counts as flat over mission length
FLAT: Final = 1.25
#: us; evidence that takes no longer costs microseconds
MICROSECONDS: Final = 100

CHOICES: Final = (
    OpenChoice(
        "missions", "X1 to X3, X5", "the steps of the three missions",
        "`short`, `standard` and `extended` of `lib:evaluation/`: 3, 6 and 12 steps with the skills and the order of "
        "the missions that ship for flying",
    ),
    OpenChoice(
        "deadline", "X1 to X3, X5", "how a deadline applies to the steps of a mission",
        "every step has the deadline of its point, counted from its release",
    ),
    OpenChoice(
        "reports", "X1 to X3, X5", "how often the vehicle reports its state",
        "each message of the signals of `lib:evaluation/` is requested twice within the shortest deadline; the radio "
        "reports every 100 ms",
    ),
    OpenChoice(
        "none", "X1, X2", "what mode `none` leaves out",
        "`none` decides and records everything, and permits each step whatever was decided. It therefore costs what "
        "`software` costs. `unenforced` takes only the steps timing, phase, state and safety of the decision, without "
        "evidence",
    ),
    OpenChoice(
        "modes", "X1 to X3, X5", "further isolated modes",
        "`process`: a separate process; `trustzone-m`: TrustZone-M in QEMU; `optee`: OP-TEE in QEMU. A mode that this "
        "computer does not have is listed as not available",
    ),
    OpenChoice(
        "languages", "X1, X2, X5", "in which language each mode decides, and so what the cost of isolation compares",
        "`none`, `unenforced` and `software` decide in Python, `process`, `trustzone-m` and `optee` in C. So X5 has "
        "two tables: less `software`, as published, which contains the change of the language and may be less than "
        "nothing; and less `process`, which is the same program in C without a secure world",
    ),
    OpenChoice(
        "repetitions", "X1 to X5", "what differs between the 30 repetitions",
        "the seed of the simulation (noise, gusts) from 1 to 30, ids and log; in X3 the inputs that the case does not "
        "strike, within their admissible ranges",
    ),
    OpenChoice(
        "end-to-end", "X1, X2, X5", "where end-to-end latency starts and ends",
        "for each invocation, from the frame that releases the step to its first command frame handed to the socket, "
        "with the evidence written in between. A second column counts from the mission's text: compile, load, sign and "
        "dispatch",
    ),
    OpenChoice(
        "clock", "X1, X2, X5", "in which time the vehicle flies",
        "the simulated vehicle in virtual time; everything between the frame that ends a step and the next command "
        "frame in real time. Frames of the vehicle are handed over in the process, those to it to a UDP socket",
    ),
    OpenChoice(
        "misses", "X1", "how a missed deadline is found",
        "by the measured times: no command frame until the deadline after the release",
    ),
    OpenChoice(
        "validation", "X1, X2, X5", "where validation latency starts and ends",
        "from the bytes of the request to the bytes of the answer of `enforce`",
    ),
    OpenChoice(
        "percentile", "X1 to X6", "how percentiles are computed",
        "by nearest rank, over all invocations of all runs of a cell",
    ),
    OpenChoice(
        "cell-average", "X2, X5", "over what the published medians are taken",
        "like the published P95: the mean of the seven deadline cells of a mission and mode; whiskers are the least "
        "and greatest of the seven",
    ),
    OpenChoice(
        "pairs", "X5", "how the modes are compared",
        "paired by mission, deadline and seed: of each pair of flights the difference of the medians and of the P95; "
        "of a point the median of its pairs. The flights in an emulator are flown after all others, and so at another "
        "load",
    ),
    OpenChoice(
        "cases", "X3", "seven of the twelve cases, all parameters, and the step that they strike",
        "the cases of the table, at `inspect_area`; `short` has none, there at `hover`. Two further cases are counted "
        "apart. A request names no version of a policy, as its binding covers it: case 13 ends as "
        "`integrity/binding-mismatch`. `integrity/policy-version` can only follow where `decide` is called with "
        "another version than its policy's, which no boundary does; tests of `decide` have it",
    ),
    OpenChoice(
        "agreement", "X3", "what is compared",
        "outcome, reason, clause, target and end of validity with those of the pure `decide`; outcome and reason with "
        "the table. In `none` a permit that is made anyway is reported, and is no disagreement",
    ),
    OpenChoice(
        "whole-runtime", "X3", "whether the decisions are also flown",
        "a second layer: the cases as faults of whole flights in virtual time, judged by what is dispatched",
    ),
    OpenChoice("conditions", "X4", "the triggered conditions", "each case whose outcome is not allow"),
    OpenChoice(
        "warm-up", "X4, X6", "what runs before it counts",
        f"X4: {WARM_ROUNDS} rounds of all conditions in the same mode; X6: {WARM_APPENDS} appends to another log. A "
        "verification opens the bundle in the log once in a process: each way is timed with that (cold) and after it; "
        "the latter is compared. No flight of X1 or X4 is repeated for warmth",
    ),
    OpenChoice(
        "reaction", "X4", "how long a fallback takes with vehicle and network; the published figures are without them",
        "a further table: in a flight of `short`, from the telemetry frame that reveals the trouble during `hover`, or "
        "that releases it when its slack has expired, to the first frame of the fallback handed to the socket. For a "
        "return that frame requests the vehicle's mode. A fallback does not wait for its record",
    ),
    OpenChoice(
        "durability", "X6", "whether an append includes its write to the disk",
        "three appends: buffered, written to the file, and synced to the disk; `written` is compared",
    ),
    OpenChoice(
        "verification", "X6", "whether verification checks signatures and derives decisions again",
        "four verifications: `--fast`, the default, `--audit --no-derive` and `--audit`; the default is compared",
    ),
    OpenChoice(
        "footprint", "X7", "which files make up a component, and how its artifact is measured",
        "the files that the table names, the size of their sources or program, and the greatest of samples of "
        "`tracemalloc`, one each 10 s of the flight of the `standard` mission (`--quick`: `short`); of a secure world "
        "its data and stack by its ELF sections, of a process its greatest resident memory. Totals are the sums of our "
        "rows",
    ),
    OpenChoice(
        "flat", "claims", "how far an overhead is flat over mission length",
        f"the largest of the three median end-to-end latencies is at most {FLAT} times the smallest, in each mode. "
        "Without enforcement there is no overhead: the ratio of `unenforced` is printed, and claims nothing",
    ),
    OpenChoice(
        "microseconds", "claims", "how far evidence costs microseconds",
        "the median append (`written`) and the median verification of a record (default) take at most "
        f"{MICROSECONDS} us",
    ),
    OpenChoice(
        "tenfold", "targets", "how much faster we want to be",
        "a tenth of the published figure, and of a range of its lower end; a missed target does not change the exit "
        "code",
    ),
    OpenChoice(
        "plots", "X1, X2, X4, X5", "the published plots have linear axes, except the second panel of X2",
        "logarithmic axes throughout, so that published and measured bars are legible on one axis. What is not above "
        "zero has no bar",
    ),
    OpenChoice(
        "peers", "comparison", "today's peers, and what shows the paper's own entries",
        "further rows by our judgement, with their sources; each entry of this system names the tests and pages that "
        "show it, and its limits",
    ),
    OpenChoice(
        "campaign", "campaign", "random faults", "flights with random faults, judged by the true state of the vehicle",
    ),
)  # fmt: skip
