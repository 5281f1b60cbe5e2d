"""What a key may be trusted for."""

from enum import StrEnum


class Duty(StrEnum):
    """One key, one duty: a key trusted for one signs nothing else (The Update Framework, section 2.1, roles)."""

    ROOT = "root"  # names all other keys
    POLICY = "policy"  # signs policies
    MISSION = "mission"  # signs missions, for the roles and through the sources that the root lists
    APPROVAL = "approval"  # answers a `confirm`
    LOG = "log"  # signs evidence
    WITNESS = "witness"  # cosigns the checkpoints of logs, away from the vehicle

    @property
    def label(self) -> bytes:
        """What is signed along with every payload, so that a signature made for one duty verifies for no other."""
        return b"rtshcua/duty/" + self.value.encode()
