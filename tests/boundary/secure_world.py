"""The boundary in the secure world and the one in Python, given the same requests."""

from typing import Any, ClassVar

import pytest

from boundary import kept as keeping
from boundary.sessions_in_c_and_python import Together
from reference.world import VEHICLE
from rtshcua.adapters.boundary.home import kept_file
from rtshcua.adapters.boundary.trustzone_m import SecureWorld, missing_packages
from rtshcua.model.flat.home_limits import TRUSTZONE_M

#: a test that needs the emulator and the programs for it
needs_emulator = pytest.mark.skipif(
    missing_packages() is not None, reason=f"no secure world here: {missing_packages()}"
)


class InSecureWorld(Together):
    """Both boundaries, the one in C in the secure world."""

    home: ClassVar[Any] = SecureWorld
    requests: ClassVar[int] = 300

    def _kept(self) -> keeping.Kept:
        sizes, blob = keeping.TRUSTZONE_M, kept_file(self._folder, VEHICLE).with_suffix(".trustzone-m").read_bytes()
        assert len(blob) == sizes.slot + 32
        return keeping.slot(blob[: sizes.slot], sizes)

    def _spoil(self) -> None:
        """There is one blob, and damage to it is damage."""


def lower_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Python keeps to the limits of the secure world."""
    for name, place in (
        ("MAX_REPLACEMENTS", "rtshcua.decision.session.MAX_REPLACEMENTS"),
        ("MAX_ANSWERS", "rtshcua.wire.approval.MAX_ANSWERS"),
        ("MAX_DISPATCHED", "rtshcua.onboard.enforcement.executor.MAX_DISPATCHED"),
        ("MOST_AHEAD", "boundary.sessions_in_c_and_python.MOST"),
    ):
        monkeypatch.setattr(place, TRUSTZONE_M[name])
