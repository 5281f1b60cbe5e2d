"""The qualification records of the user's vehicles, the last one of each:
`<data folder>/qualifications/vehicle-<identity>.cbor`.
"""

from pathlib import Path
from urllib.parse import quote

from rtshcua.adapters.store.reading import read_if_there
from rtshcua.adapters.store.writing import PRIVATE_FOLDER, make_folder, replace
from rtshcua.wire.qualification import MAX_QUALIFICATION


def path_of(data: Path, vehicle: str) -> Path:
    """Where the record of the vehicle of this identity is."""
    return data / "qualifications" / f"vehicle-{quote(vehicle, safe='')}.cbor"


def read_record(data: Path, vehicle: str) -> bytes | None:
    """The signed record, unverified; None where the vehicle has none. Raises OSError."""
    return read_if_there(path_of(data, vehicle), MAX_QUALIFICATION)


def keep_record(data: Path, vehicle: str, signed: bytes) -> Path:
    """Keep it in place of the one before, and give where. Raises OSError."""
    path = path_of(data, vehicle)
    make_folder(path.parent, mode=PRIVATE_FOLDER)
    replace(path, signed)
    return path
