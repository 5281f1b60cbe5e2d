"""The bases of the flat structs: frozen, array-like, no surplus fields."""

from typing import ClassVar

import msgspec


class Flat(msgspec.Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """An immutable record whose wire form is the array of its fields."""


class Extended(Flat, frozen=True):
    """A record that has got more fields. Its wire form leaves out the last ones that have their defaults, down to the
    first `LEAST`, so that records without the new fields keep their bytes.
    """

    LEAST: ClassVar[int] = 0
