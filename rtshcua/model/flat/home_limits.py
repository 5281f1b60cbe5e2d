"""What fits in a home of the boundary with little memory: smaller limits, in place of those of the same name.

The C of such a home is built with tables of these sizes (`.make/limits`), and refuses a bundle that exceeds one.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

#: `trustzone-m` and `optee`: the state stays below 310 KB, the peak that the paper gives for its trusted application
TRUSTZONE_M: Final[Mapping[str, int]] = MappingProxyType(
    {
        "MAX_BUNDLE": 1 << 16,
        "MAX_DOCUMENT": 1 << 14,
        "MAX_REPLACEMENTS": 2,
        "MAX_ROOT": 1 << 14,
        "MAX_PART": 18_000,
        "MOST_AHEAD": 60,
        "MOST_OPENED": 128,
        "MOST_POLICIES": 16,
        "MAX_ROLES": 16,
        "MAX_ZONES": 64,
        "MAX_TOTAL_VERTICES": 1_024,
        "MAX_TABLES": 32,
        "MAX_SETS": 128,
        "MAX_CONTRACTS": 32,
        "MAX_RULES": 128,
        "MAX_INVOCATIONS": 64,
        "MAX_KEYS": 32,
        "MAX_ANSWERS": 32,
        "MAX_DISPATCHED": 1_024,
    }
)
