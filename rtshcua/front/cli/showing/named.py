"""Flat structs for programs: every field by its name, octets in hexadecimal."""

import msgspec


def named(value: object) -> object:
    """The value made of what JSON has."""
    if isinstance(value, msgspec.Struct):
        return {field: named(getattr(value, field)) for field in value.__struct_fields__}
    if isinstance(value, (tuple, list)):
        return [named(each) for each in value]
    return value.hex() if isinstance(value, bytes) else value
