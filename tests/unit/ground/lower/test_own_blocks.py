"""Contracts are proved with a step's own block, and links with the limits of their chain."""

from pathlib import Path

from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import check_program
from rtshcua.mavlink import dialect
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[4]
LIBRARY = str(CHECKOUT / "tests/golden/checker/library")
HEAD = "".join(
    f'import "lib:{path}.rts"\n'
    for path in (
        "policies/site",
        "skills/signals",
        *(f"skills/{each}" for each in ("takeoff", "hover", "goto", "return_home", "emergency_land")),
    )
)
TEXT = """
skill watch(time: duration in 1 s .. 25 s = 10 s) {{
  motion   hold for time
  class    tactical
  deadline 5 s
  valid    for 20 min
  lasts    at most 30 s
  grace    100 ms
  require  gps.fix >= fix_3d
  assume   wind.speed < 8 m/s
  fallback {chain}, emergency_land
  energy   at most 4 %
  record   intent, decision, state, authorization, effect
}}
skill wait_here() {{
  motion   hold
  class    tactical
  deadline 5 s
  valid    for 20 min
  fallback return_home, emergency_land
  energy   at most 3 %
  record   intent, decision, state, authorization, effect
}}
policy rules version 1 {{
  permit  takeoff by role operator when altitude <= 40 m
  permit  watch by role operator
  permit  hover, return_home, emergency_land, wait_here by any
  {rule}
  contingency return_home, emergency_land
}}
mission m under rules@1 on quad {{
  proposed by operator x for role operator
  phase departure {{ takeoff(altitude = 20 m) {skip} }}
  phase inspection {{ watch(1 s) {own} }}
  phase recovery {{ return_home() }}
}}
"""


def findings(chain: str = "return_home", rule: str = "", own: str = "", skip: str = "") -> list[Diagnostic]:
    """Return all findings of a mission of three steps."""
    source = (HEAD + TEXT.format(chain=chain, rule=rule, own=own, skip=skip)).encode()
    read = load(["x.rts"], lambda path: source if path == "x.rts" else Path(path).read_bytes(), LIBRARY)
    return list(check_program(read, dialect.load()))


def quoted(found: Diagnostic, **parts: str) -> str:
    assert found.span is not None
    parts = {"chain": "return_home", "rule": "", "own": "", "skip": ""} | parts
    return (HEAD + TEXT.format(**parts))[found.span.start : found.span.end]


@rows(
    ("own", "code", "at"),
    [
        ("", None, ""),
        ("{ deadline 2 s }", None, ""),
        ("{ deadline 49 ms }", "E0717", "49 ms"),
        ("{ lasts at most 1100 ms }", "E0808", "1100 ms"),
        ("{ maintain time <= 20 s }", "E1203", "time <= 20 s"),
        ("{ assume time >= 1 s }", "E1203", "time >= 1 s"),
        ("{ require time >= 1 s }", "E1102", "time >= 1 s"),
        ("{ require time >= 2 s }", "E0616", "watch(1 s) { require time >= 2 s }"),
    ],
)
def test_own_block_is_proved_like_its_skill(own: str, code: str | None, at: str) -> None:
    found = {each.code.id: quoted(each, own=own) for each in findings(own=own)}
    assert code in found if code else not found
    if code:
        assert found[code] == at


@rows(
    ("parts", "code", "at"),
    [
        ({"rule": "degrade any when battery < 20 % to wait_here"}, "E0611", "wait_here"),
        ({"rule": "degrade any when battery < 20 % to wait_here for 20 s"}, None, ""),
        ({"chain": "hover for 60 s, return_home"}, "E0806", "60 s"),
        ({"chain": "hover for 35 s, return_home"}, None, ""),
        ({"rule": "confirm watch by role operator within 1999 ms"}, "E0717", "1999 ms"),
        ({"rule": "confirm watch by role operator within 2 s"}, None, ""),
    ],
)
def test_links_and_approvals_must_be_feasible(parts: dict[str, str], code: str | None, at: str) -> None:
    found = findings(**parts)
    assert [(each.code.id, quoted(each, **parts)) for each in found] == ([(code, at)] if code else [])


def test_message_names_the_skipped_step_that_leaves_the_vehicle_down() -> None:
    [found] = findings(skip="on inadmissible skip")
    assert (found.code.id, found.labels[-1].text) == ("E0619", "this step may be skipped")
