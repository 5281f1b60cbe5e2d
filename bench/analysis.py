"""Analysis of a policy's rules against each other: the time for 100 rules, and its growth to 1,000.

The generated policy resembles real ones: a few skills, a crew for every ten rules, conditions over arguments, zones,
signals and the time of day, a tenth of them forbids, and some dead or redundant rules. Only the analysis is timed, not
parsing, checking and lowering. Exits with 1 when a limit is exceeded.
"""

import gc
import sys
from math import log
from pathlib import Path
from statistics import median
from time import process_time
from unittest.mock import patch

from rtshcua.diagnostics import codes
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import check_program
from rtshcua.ground.prove import contradiction, proofs, rule_checks
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.mavlink import dialect

SIZES = (100, 300, 1_000)
SECONDS = 2.0
"""The limit for the smallest policy."""
GROWTH = 1.5
"""The greatest exponent of growth: 1 is proportional to the rules, 2 to their pairs."""
ONE_ROLE = 10.0
"""The limit for the largest policy if all rules are about the same role, so that all pairs matter."""
ROUNDS = 3

ROOT = Path(__file__).resolve().parents[1]
SKILLS = ("takeoff", "hover", "goto", "inspect_area", "return_home", "emergency_land")
HEAD = "".join(f'import "lib:{path}"\n' for path in ("policies/site.rts", *(f"skills/{name}.rts" for name in SKILLS)))


def source(count: int, crews: int = 50) -> str:
    """Return a policy of about that many rules, for at most so many crews of ten rules."""
    crews = min(max(count // 10, 1), crews)
    declared = f"role {', '.join(f'crew_{number}' for number in range(crews))}"
    parts = [HEAD, declared, "policy large version 1 {", "  permit hover, return_home, emergency_land by any"]
    for number in range(count - 1):
        crew, turn = f"crew_{number % crews}", number // crews
        low, high = 5 + 5 * (turn % 8), 12 + 5 * (turn % 8)
        bridge = ("bridge_a", "bridge_b")[turn % 2]
        parts.append(
            (
                f"permit goto by role {crew} through agent when target inside city and altitude in {low} m .. {high} m",
                f"permit inspect_area by role {crew} when area inside {bridge} and altitude <= {high} m",
                f"permit takeoff, goto by role {crew} when altitude <= {high} m and battery > {30 + turn % 40} %",
                f"permit goto by role {crew} when target inside meadow and local time in 0{6 + turn % 3}:00 .. 18:00",
                f"forbid goto by role {crew} when target inside grow(school, {20 + turn} m) or speed > {high} m/s",
                f"permit inspect_area by role {crew} when position inside city and altitude < {low + 20} m",
                f"permit goto by role {crew} when height <= altitude + {low} m and target outside school",
                f"confirm inspect_area when altitude < {6 + number % 9} m by role {crew} within 30 s",
                f"permit goto by role {crew} when (target inside {bridge} or speed < 3 m/s) and gps.fix >= fix_3d",
                f"permit takeoff by role {crew} through agent when altitude < {3 + number % 4} m and battery > 50 %",
            )[turn % 10]
        )
    parts += ["  airspace inside city outside school", "  contingency hover for 10 s, return_home, emergency_land", "}"]
    return "\n".join(parts)


def ground(text: str) -> ProofContext:
    """Return the policy, lowered and prepared for the analysis."""
    found: list[ProofContext] = []
    proved = (*proofs.POLICY_PROOFS[:-1], found.append)  # the rules are proved later, and timed
    with patch.object(proofs, "POLICY_PROOFS", proved):
        diagnostics = check_program(load(["large.rts"], lambda path: _read(path, text), str(ROOT)), dialect.load())
    assert found, diagnostics
    return found[0]


def _read(path: str, text: str) -> bytes:
    return text.encode() if path == "large.rts" else Path(path).read_bytes()


def seconds(text: str) -> tuple[float, ProofContext]:
    """Return the processor time of the analysis, and its size."""
    made = ground(text)
    made.questions.forget()
    gc.collect()
    start = process_time()
    contradiction.prove_contracts(made)
    rule_checks.prove_rules(made)
    return process_time() - start, made


def main() -> int:
    """Measure and print; return 1 if a limit is missed."""
    seconds(source(20))  # warm: tables are read, code is compiled
    times: list[float] = []
    for size in SIZES:
        runs = [seconds(source(size)) for _ in range(ROUNDS)]
        times.append(median(time for time, _ in runs))
        found = [each.code for each in runs[0][1].context.report.found]
        told = ", ".join(f"{found.count(code)} {code.slug}" for code in dict.fromkeys(found) if code != codes.NAMING)
        print(f"analysis: {size:,} rules take {times[-1]:.2f} s ({told or 'no finding'})")
    one, _ = seconds(source(SIZES[-1], crews=1))
    print(f"analysis: {SIZES[-1]:,} rules that are all about one role take {one:.2f} s, limit {ONE_ROLE:g}")
    growth = log(times[-1] / times[0]) / log(SIZES[-1] / SIZES[0])
    print(
        f"analysis: {SIZES[0]} rules take {times[0]:.2f} s, limit {SECONDS:g}; exponent {growth:.2f}, limit {GROWTH:g}"
    )
    return int(times[0] > SECONDS or growth > GROWTH or one > ONE_ROLE)


if __name__ == "__main__":
    sys.exit(main())
