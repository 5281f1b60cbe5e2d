"""The comparison table of the paper, with this system and today's peers: data for the report.

`COMPARISON` is a tuple of `ComparedWork`, in the order of the page: the paper's rows, today's peers, this system. Each
has one `ComparedEntry` for each of `COLUMNS`, in their order. An entry says whether a property is an aim of the design,
not whether one mechanism for it exists. In the row of this system (`OURS`) each entry names the tests and pages that
show it, as paths in the repository. Rows of the paper repeat its judgement alone; rows of peers are our judgement, by
the sources that they name, read in November 2026.
"""

from enum import StrEnum
from typing import Final, NamedTuple


class Aim(StrEnum):
    """Whether a property is an aim of a design: a first-class one, in part, or not at all."""

    YES = "yes"
    PART = "part"
    NO = "no"


class Judge(StrEnum):
    """Who judged a row. `PAPER` marks what is only repeated here."""

    PAPER = "[P]"
    OURS = "[ours]"


class ComparedProperty(NamedTuple):
    """A property: its key, its title in a table, and what counts as an aim."""

    key: str
    title: str
    meaning: str


class ComparedEntry(NamedTuple):
    """One entry. `shown_by`: paths of tests and pages, for this system alone. `limits` says what does not hold."""

    aim: Aim
    shown_by: tuple[str, ...] = ()
    limits: str = ""


class ComparedWork(NamedTuple):
    """A row: one entry for each column. `sources` are addresses; `note` says in a sentence what decided the row."""

    work: str
    judge: Judge
    entries: tuple[ComparedEntry, ...]
    sources: tuple[str, ...] = ()
    note: str = ""

    def entry(self, key: str) -> ComparedEntry:
        """The entry in the column of a key. Raises StopIteration for an unknown one."""
        return self.entries[next(at for at, column in enumerate(COLUMNS) if column.key == key)]


COLUMNS: Final = (
    ComparedProperty("physical", "physical interface", "commands to a vehicle, and its state, are part of the model"),
    ComparedProperty(
        "deadline", "deadline admission", "an action is admitted against a deadline before it is dispatched"
    ),
    ComparedProperty("fallback", "fallback path", "what is not admitted leads to a bounded action instead"),
    ComparedProperty("security", "security, accountability", "authority is checked, and evidence of decisions is kept"),
    ComparedProperty("isolation", "trusted isolation", "enforcement is out of reach of what it restricts"),
    ComparedProperty(
        "restructuring", "agent restructuring", "the agent proposes within contracts instead of acting itself"
    ),
)

_AIMS: Final = {"y": Aim.YES, "p": Aim.PART, "n": Aim.NO}


def _entries(aims: str) -> tuple[ComparedEntry, ...]:
    """Entries from a letter for each column: y, p or n."""
    return tuple(ComparedEntry(_AIMS[letter]) for letter in aims)


def _published(work: str, aims: str) -> ComparedWork:
    return ComparedWork(work, Judge.PAPER, _entries(aims))


def _peer(work: str, aims: str, note: str, *sources: str) -> ComparedWork:
    return ComparedWork(work, Judge.OURS, _entries(aims), sources, note)


OURS: Final = ComparedWork(
    "this system",
    Judge.OURS,
    (
        ComparedEntry(
            Aim.YES, ("docs/flying/vehicles.md", "tests/integration/test_flight_whole.py"),
            "Flown are simulated vehicles; no physical flight is claimed.",
        ),
        ComparedEntry(Aim.YES, (
            "tests/theorems/test_theorem_1_admission.py", "tests/theorems/test_assumption_2_enforcement.py",
            "tests/unit/decision/test_reference_cases.py",
        )),
        ComparedEntry(Aim.YES, (
            "tests/theorems/test_theorem_2_fallback.py", "tests/theorems/test_assumption_3_bounded.py",
            "docs/flying/campaigns.md",
        )),
        ComparedEntry(Aim.YES, (
            "tests/theorems/test_theorem_3_evidence.py", "tests/theorems/test_assumption_2_enforcement.py",
            "docs/verifying.md",
        )),
        ComparedEntry(
            Aim.YES,
            (
                "docs/flying/isolation.md", "tests/theorems/test_assumption_4_path.py",
                "tests/attacks/test_boundary_process.py", "tests/attacks/test_runtime_taken_over.py",
                "tests/attacks/test_secure_world.py", "tests/attacks/test_trusted_application.py",
            ),
            "In `process`, `trustzone-m` and `optee`, not in `software`. The secure worlds are emulated: root of the "
            "host reads everything. An old state that is put back is accepted, and only a witness shows it. A vehicle "
            "that enforces no MAVLink signing obeys anyone who reaches its link.",
        ),
        ComparedEntry(Aim.YES, (
            "docs/agents.md", "tests/theorems/test_corollary_1_agent.py", "tests/integration/test_mcp_session.py",
        )),
    ),
    note="The secure worlds are emulated, and no physical flight is claimed.",
)  # fmt: skip

COMPARISON: Final = (
    _published("natural-language UAV control", "ypppnn"),
    _published("agentic aerial frameworks (AerialClaw)", "ypppnp"),
    _published("embodied agents, VLAs", "ypppnn"),
    _published("tool-use and computer-use agents", "pnppnn"),
    _published("computer-use agent safety", "pnpypp"),
    _published("host-side SHCUA, OpenClaw security", "pppypp"),
    _published("low-latency planning, compact forms (TypeFly)", "pyppnn"),
    _published("safety supervision, runtime assurance", "ypypnn"),
    _published("prompt-injection defence", "pnpypn"),
    _published("TEE, isolated enforcement", "pppyyn"),
    _published("the paper", "yyyyyy"),
    _peer(
        "MAVSDK", "ynnnnn", "A command succeeds or fails by the vehicle's acknowledgement; nothing admits it before.",
        "https://mavsdk.mavlink.io/main/en/cpp/guide/general_usage.html",
    ),
    _peer(
        "PX4 failsafes", "ypypnn",
        "Lost links, charge, wind and fences have bounded actions, and so has a stale offboard signal. Links can be "
        "signed, but commands have no authority of their own.",
        "https://docs.px4.io/v1.16/config/failsafe/index.html",
    ),
    _peer(
        "mavlink-router", "pnnpnn",
        "Allow and block lists by message, system and component; no arguments, no state, and no answer to the sender.",
        "https://github.com/mavlink-router/mavlink-router/blob/master/examples/config.sample",
    ),
    _peer(
        "QGroundControl", "ynppnn",
        "A person confirms each action with a slider, and can pause most of them; the autopilot falls back.",
        "https://github.com/mavlink/qgroundcontrol/blob/master/docs/en/qgc-user-guide/fly_view/fly_view.md",
    ),
    _peer(
        "Flight Review", "pnnpnn", "Analyses logs after a flight; the logs have no integrity protection as a whole.",
        "https://github.com/PX4/flight_review",
    ),
    _peer(
        "droneserver (MCP)", "ynnpnp",
        "MAVSDK as tools for a model, with waiting and progress made for models; a safety layer outside of the model.",
        "https://arxiv.org/html/2601.15486v1", "https://github.com/PeterJBurke/droneserver",
    ),
    _peer(
        "mavlink-mcp", "ynnpnp",
        "Eight capabilities; read-only by default, confirmation, a ceiling and a soft fence, in the agent's process.",
        "https://glama.ai/mcp/servers/hieutachi/mavlink-mcp/schema",
    ),
    _peer(
        "SINT", "pppypp",
        "Signed tokens with physical limits and expiry, tiers of approval, a hash-chained ledger, and abort behaviour "
        "bound to a mission; attestation is pluggable.",
        "https://raw.githubusercontent.com/sint-ai/sint-protocol/main/README.md",
    ),
    _peer(
        "Cedar", "nnnynn", "Policies with permit and forbid; the answer is allow or deny, and the caller enforces it.",
        "https://aws.amazon.com/blogs/security/how-we-designed-cedar-to-be-intuitive-to-use-fast-and-safe/",
    ),
    _peer(
        "OPA", "nnnynn", "Policies over any input, and decision logs for audit; the caller enforces the answer.",
        "https://openpolicyagent.org/docs/latest/decision-logs",
    ),
    _peer(
        "TUF", "npnynn",
        "Keys by role, thresholds, expiry and protection against rollback, of files; freshness is not a deadline.",
        "https://theupdateframework.github.io/specification/",
    ),
    _peer(
        "Certificate Transparency", "nnnynn",
        "Append-only logs with proofs of inclusion and consistency, whose signed heads are compared.",
        "https://datatracker.ietf.org/doc/html/draft-ietf-trans-rfc6962-bis-19",
    ),
    OURS,
)  # fmt: skip
