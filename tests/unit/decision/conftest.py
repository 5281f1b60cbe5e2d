"""The hand-written flat policy and mission in tests/reference are importable as `reference.flat_case`."""

import sys
from pathlib import Path

TESTS = str(Path(__file__).resolve().parents[2])
if TESTS not in sys.path:
    sys.path.insert(0, TESTS)
