"""Compiling, end to end, compared with a plain Lark parse with positions of the same text.

The text is one policy with many rules and many missions, up to 50,000 lines in one file. Compiling means: parse to the
IR, check, lower and prove every mission, and encode one mission with its policy. Both run in this process, in turns,
with the same garbage collector settings. Exits with 1 when the ratio or the memory is above its limit, or when the
time does not grow linearly.
"""

import gc
import resource
import sys
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import process_time_ns

from rtshcua.ground.language.generate import GRAMMAR, lark
from rtshcua.ground.language.load import load
from rtshcua.ground.language.parse import parse
from rtshcua.ground.pipeline.program import compile_program
from rtshcua.mavlink import dialect
from rtshcua.wire.binding import bind
from rtshcua.wire.bundle import mission_payload, policy_digest, policy_payload

LIMIT = 4.0
SPREAD = 1.6  # the time per line of the largest text, relative to the smallest
MEMORY_MIB = 512
SIZES = (5_000, 15_000, 50_000)
ROUNDS = 3

ROOT = Path(__file__).resolve().parents[1]
HEAD = (
    "\n".join(
        f'import "lib:{file}"'
        for file in (
            "policies/site.rts",
            *(
                f"skills/{name}.rts"
                for name in ("takeoff", "hover", "goto", "inspect_area", "return_home", "emergency_land")
            ),
        )
    )
    + "\n"
)

MISSION = """

mission flight_{0} under large@1 on quad {{
  intent   "Flight number {0}."
  proposed by agent openclaw for role operator

  phase departure {{
    takeoff(altitude = {1} m)   // straight up
  }}
  phase inspection {{
    goto(47.39800 N, 8.5458{2} E, altitude = 15 m)
    hover(time = {2} s)
  }}
  phase recovery {{
    return_home()
  }}
}}
"""


def source(lines: int) -> str:
    """Return a text of about that many lines: a fifth rules, the rest missions of 16 lines.

    For any length, ten rules are about each skill of the missions' role; all others are about other roles.
    """
    rules = lines // 10
    crews = ", ".join(f"crew_{number}" for number in range(50))
    parts = [HEAD, f"role {crews}", "policy large version 1 {", "  permit hover, return_home, emergency_land by any"]
    for number in range(rules):
        role = "operator" if number < 10 else f"crew_{number % 50}"
        parts += [
            f"  permit  takeoff, goto by role {role} through agent, operator",
            f"          when altitude <= {20 + number % 20} m and battery > {20 + number % 30} %",
        ]
    parts += ["  airspace inside city outside school", "  contingency hover for 10 s, return_home, emergency_land", "}"]
    missions = (lines - 2 * rules) // 16
    return "\n".join(parts) + "".join(
        MISSION.format(number, 10 + number % 10, 1 + number % 9) for number in range(missions)
    )


def compiled(text: str) -> int:
    """Compile the text to the payloads of a policy and a mission; return their size."""
    data = text.encode()

    def read(path: str) -> bytes:
        return data if path == "large.rts" else Path(path).read_bytes()

    program = load(["large.rts"], read, str(ROOT), parse=parse)
    found = compile_program(program, dialect.load(), mission="flight_0", issued_at_us=0)
    assert found.policy is not None, found.diagnostics
    assert found.mission is not None
    payload = policy_payload(found.policy)
    return len(payload) + len(mission_payload(bind(found.mission, policy_digest(payload))))


def milliseconds(run: Callable[[str], object], text: str) -> float:
    """Return the processor time of one call, which depends little on other load."""
    gc.collect()
    start = process_time_ns()
    run(text)
    return (process_time_ns() - start) / 1e6


def main() -> int:
    """Measure and print; return 1 if a limit is missed."""
    bare = lark(GRAMMAR.read_text(encoding="utf-8")).parse
    compiled(source(500)), bare(source(500))  # warm: tables are read, code is compiled
    good = True
    costs: list[float] = []
    for size in SIZES:
        text = source(size)
        lines = text.count("\n")
        rounds = [(milliseconds(compiled, text), milliseconds(bare, text)) for _ in range(ROUNDS)]
        ours_ms, bare_ms = median(a for a, _ in rounds), median(b for _, b in rounds)
        ratio = median(a / b for a, b in rounds)
        costs.append(ours_ms / lines)
        good = good and ratio <= LIMIT
        print(
            f"compile: {lines:,} lines take {ratio:.2f} times a bare Lark parse, limit {LIMIT:g} "
            f"({ours_ms:,.0f} ms against {bare_ms:,.0f} ms, medians of {ROUNDS}; {1000 * costs[-1]:.0f} us a line)"
        )
    growth = costs[-1] / costs[0]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1 << 20 if sys.platform == "darwin" else 1 << 10)
    print(
        f"compile: a line of {SIZES[-1]:,} costs {growth:.2f} times one of {SIZES[0]:,}, limit {SPREAD}; "
        f"at most {peak:,.0f} MiB of memory, limit {MEMORY_MIB}"
    )
    return int(not good or growth > SPREAD or peak > MEMORY_MIB)


if __name__ == "__main__":
    sys.exit(main())
