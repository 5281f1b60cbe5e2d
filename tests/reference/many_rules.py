"""Policies with many rules that overlap little, much or completely."""

from collections.abc import Callable, Mapping

IMPORTS = "".join(
    f'import "lib:{file}.rts"\n'
    for file in (
        "policies/site",
        "skills/hover",
        "skills/goto",
        "skills/return_home",
        "skills/emergency_land",
    )
)


def _band(number: int, width: int) -> str:
    return f"altitude >= {5_000 + 10 * number} mm and altitude <= {5_000 + 10 * number + width} mm"


#: a rule by its number
KINDS: Mapping[str, Callable[[int], str]] = {
    "alike": lambda number: "permit goto by role operator when altitude <= 30 m",
    "nested": lambda number: f"permit goto by role operator when altitude <= {5_000 + 10 * number} mm",
    "apart": lambda number: f"permit goto by role operator when {_band(number, 5)}",
    "overlapping": lambda number: f"permit goto by role operator when {_band(number, 15)}",
    "roles": lambda number: f"permit goto by role r{number % 60} when {_band(number, 5)}",
    "forbids": lambda number: f"forbid goto by any when {_band(number, 5)}",
    "stairs": lambda number: (
        f"permit goto by role operator when altitude <= {5_000 + 10 * number} mm and speed <= {8_000 - number} mm/s"
    ),
    "either": lambda number: (
        f"permit goto by role operator when altitude <= {5_000 + 10 * number} mm or speed <= {1_000 + number} mm/s"
    ),
    "zones": lambda number: (
        f"permit goto by role operator when target inside grow(bridge_a, {number % 50 + 1} m)"
        f" and altitude <= {5_000 + 10 * number} mm"
    ),
    "confirms": lambda number: f"confirm goto when {_band(number, 5)} by role supervisor within 30 s",
    "nested confirms": lambda number: (
        f"confirm goto when altitude <= {5_000 + 10 * number} mm by role supervisor within 30 s"
    ),
    "degrades": lambda number: f"degrade goto when {_band(number, 5)} to return_home",
    "degrades to two": lambda number: (
        f"degrade goto when {_band(number, 5)} to {'return_home' if number % 2 else 'emergency_land'}"
    ),
    "dead": lambda number: f"permit goto by role operator when altitude > {70_000 + number} mm",
}


#: the roles that the rules name, besides `operator`
ROLES = f"role supervisor, {', '.join(f'r{number}' for number in range(60))}\n"


def policy(kind: str, rules: int) -> str:
    """Return a source with a policy of many rules of a kind."""
    lines = "".join(f"  {KINDS[kind](number)}\n" for number in range(rules))
    return (
        f"{IMPORTS}{ROLES}policy many version 1 {{\n  permit hover, return_home, emergency_land by any\n{lines}"
        "  contingency hover for 10 s, return_home, emergency_land\n}\n"
    )
