"""Which parameters of a vehicle were set for a flight and are to be put back: kept until they are, whatever happens to
the run that set them.

    <state folder>/parameters/vehicle-<identity>     JSON: {name: [value before, value that was set]}, values as text

It is on the disk before anything is set. One run at a time flies a vehicle, and writes.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import quote

from rtshcua.adapters.store.reading import read_if_there
from rtshcua.adapters.store.writing import PRIVATE_FILE, PRIVATE_FOLDER, make_folder, replace
from rtshcua.mavlink.parameters import bits_of, is_name, shown
from rtshcua.onboard.enforcement.preparation import Owed

_LARGEST = 1 << 16  # octets of the file


class OwedParameters:
    """What is owed to the vehicle called `vehicle` (its identity)."""

    def __init__(self, state: Path, vehicle: str) -> None:
        self.path = state / "parameters" / f"vehicle-{quote(vehicle, safe='')}"

    def read(self) -> dict[str, Owed]:
        """What is to be put back. Raises OSError, and ValueError for a file that says nothing of the kind."""
        data = read_if_there(self.path, _LARGEST)
        if data is None:
            return {}
        try:
            told = json.loads(data)
        except (ValueError, RecursionError):
            told = None
        if not isinstance(told, dict):
            raise ValueError(f"`{self.path}` is damaged")
        return {name: self._owed(name, values) for name, values in told.items()}

    def write(self, owed: Mapping[str, Owed]) -> None:
        """Keep this; it is on the disk then. Raises OSError."""
        make_folder(self.path.parent, mode=PRIVATE_FOLDER)
        told = {name: [shown(each.before), shown(each.value)] for name, each in owed.items()}
        replace(self.path, json.dumps(told, sort_keys=True).encode() + b"\n", mode=PRIVATE_FILE)

    def _owed(self, name: str, values: object) -> Owed:
        if is_name(name) and isinstance(values, list) and len(values) == 2:
            found = [_bits(each) for each in values]
            if found[0] is not None and found[1] is not None:
                return Owed(found[0], found[1])
        raise ValueError(f"`{self.path}` is damaged")


def _bits(text: object) -> int | None:
    try:
        return bits_of(float(text)) if isinstance(text, str) else None
    except ValueError:
        return None
