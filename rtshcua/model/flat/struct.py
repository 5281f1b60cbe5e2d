"""The base of the flat structs: frozen, array-like, no surplus fields."""

import msgspec


class Flat(msgspec.Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """An immutable record whose wire form is the array of its fields."""
