"""Which parameters of a vehicle were set for a flight and are to be put back: kept until they are, whatever happens to
the run that set them.

    <state folder>/parameters/vehicle-<identity>     JSON: {name: [value before, value that was set]}, values as text

It is on the disk before anything is set. A run that may set or put back something holds the file `lock-<identity>`
beside it: what another run owes that still lives is nobody else's to put back.
"""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import quote

from rtshcua.adapters.store.reading import read_if_there
from rtshcua.adapters.store.writing import PRIVATE_FILE, PRIVATE_FOLDER, lock, make_folder, replace
from rtshcua.mavlink.parameters import bits_of, shown
from rtshcua.onboard.enforcement.preparation import SETTABLE, Owed

_LARGEST = 1 << 16  # octets of the file


class OwedParameters:
    """What is owed to the vehicle called `vehicle` (its identity), as it was found when this was made.

    `left` is what is to be put back; where nobody can tell, it is empty, and `trouble` says why: nothing is set then.
    `sets` is whether a run sets something; None for one who only looks. A run that does, or to which something is left,
    holds it until it is closed or its process dies; where another run holds it, nothing is left to this one.
    """

    def __init__(self, state: Path, vehicle: str, *, sets: bool | None = None) -> None:
        name = quote(vehicle, safe="")
        self.path = state / "parameters" / f"vehicle-{name}"
        self.left: Mapping[str, Owed] = {}
        self.trouble: str | None = None
        self._lock: int | None = None
        try:
            left = self._read()
            if sets or (sets is not None and left):
                make_folder(self.path.parent, mode=PRIVATE_FOLDER)
                self._lock = lock(self.path.with_name(f"lock-{name}"))
                left = self._read()  # whoever held it before has put back some of it since
            self.left = left
        except BlockingIOError:
            self.trouble = f"another run of `{vehicle}` sets its parameters, and puts them back"
        except (OSError, ValueError) as error:
            why = str(error) if isinstance(error, ValueError) else (error.strerror or str(error)).lower()
            self.trouble = f"it is not known which parameters are to be put back: {why}"

    def close(self) -> None:
        """Let another run have it."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def _read(self) -> dict[str, Owed]:
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

    def keep(self, owed: Mapping[str, Owed]) -> None:
        """From now on this is owed; it is on the disk then. Raises OSError."""
        make_folder(self.path.parent, mode=PRIVATE_FOLDER)
        told = {name: [shown(each.before), shown(each.value)] for name, each in owed.items()}
        replace(self.path, json.dumps(told, sort_keys=True).encode() + b"\n", mode=PRIVATE_FILE)

    def _owed(self, name: str, values: object) -> Owed:
        if name in SETTABLE and isinstance(values, list) and len(values) == 2:
            found = [_bits(each) for each in values]
            if found[0] is not None and found[1] is not None:
                return Owed(found[0], found[1])
        raise ValueError(f"`{self.path}` is damaged")


def _bits(text: object) -> int | None:
    try:
        return bits_of(float(text)) if isinstance(text, str) else None
    except ValueError:
        return None
