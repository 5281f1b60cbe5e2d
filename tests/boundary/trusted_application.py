"""The boundary in OP-TEE and the one in Python, given the same requests."""

from contextlib import closing
from typing import Any, ClassVar

import pytest

from boundary import kept as keeping
from boundary.sessions_in_c_and_python import PIN, SIGNED_ROOT, Together
from reference.world import VEHICLE
from rtshcua.adapters.boundary.optee import TrustedApplication, missing_packages

#: a test that needs the emulator, and what it runs
needs_optee = pytest.mark.skipif(missing_packages() is not None, reason=f"no OP-TEE here: {missing_packages()}")


class InTrustedApplication(Together):
    """Both boundaries, the one in C in OP-TEE."""

    home: ClassVar[Any] = TrustedApplication
    requests: ClassVar[int] = 300

    def _kept(self) -> keeping.Kept:
        """Secure storage can only be read by the application, so it is started once more."""
        with closing(TrustedApplication(SIGNED_ROOT, PIN, VEHICLE, self._folder, paced=True)) as look:
            blob = look.kept()
        self._restarts += 1
        assert len(blob) == keeping.TRUSTZONE_M.slot + 32
        return keeping.slot(blob[: keeping.TRUSTZONE_M.slot], keeping.TRUSTZONE_M)

    def _spoil(self) -> None:
        """There is one object, and damage to it is damage."""
