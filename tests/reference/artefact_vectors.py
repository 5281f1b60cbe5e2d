"""Writes the artefacts of the present versions in tests/vectors/artefacts, after a version was raised.

`python tests/reference/artefact_vectors.py` writes them, always the same octets. Those of earlier versions stay.
"""

import sys
from pathlib import Path

if __package__ in (None, ""):
    sys.path.insert(0, str(Path(__file__).parents[1]))

from reference.documents import approval, low, recall, replacement
from reference.world import ROOT, ROOT_KEY, sealed
from rtshcua.wire import names

FOLDER = Path(__file__).parents[1] / "vectors" / "artefacts"


def made() -> dict[str, bytes]:
    """Return the artefacts by file name."""
    of = low()
    return {
        f"root-{names.ROOT.version}": ROOT.sign(ROOT_KEY),
        f"policy-{names.POLICY.version}": sealed(),
        f"approval-{names.APPROVAL.version}": approval(of),
        f"recall-{names.RECALL.version}": recall(of),
        f"replacement-{names.REPLACEMENT.version}": replacement(of),
    }


if __name__ == "__main__":
    for name, octets in made().items():
        (FOLDER / name).write_bytes(octets)
