"""The cases and flights in tests/reference and tests/virtual are importable as `reference` and `virtual`."""

import sys
from pathlib import Path

TESTS = str(Path(__file__).resolve().parents[2])
if TESTS not in sys.path:
    sys.path.insert(0, TESTS)
