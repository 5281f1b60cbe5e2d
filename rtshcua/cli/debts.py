"""What earlier runs left to be put back of a vehicle's parameters, as it was found when this one began."""

from collections.abc import Mapping
from pathlib import Path

from rtshcua.adapters.files.owed import OwedParameters
from rtshcua.onboard.enforcement.preparation import Owed


class Debts:
    """`left` is what is owed; where nobody can tell, `trouble` says why, and nothing is set then."""

    def __init__(self, state: Path, vehicle: str) -> None:
        self._kept = OwedParameters(state, vehicle)
        self.left: Mapping[str, Owed] = {}
        self.trouble: str | None = None
        try:
            self.left = self._kept.read()
        except (OSError, ValueError) as error:
            why = str(error) if isinstance(error, ValueError) else (error.strerror or str(error)).lower()
            self.trouble = f"it is not known which parameters are to be put back: {why}"

    def keep(self, owed: Mapping[str, Owed]) -> None:
        """From now on this is owed; it is on the disk then. Raises OSError."""
        self._kept.write(owed)
