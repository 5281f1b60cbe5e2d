"""The values of which a struct's canonical bytes are made.

`msgspec` writes every field of an array-like struct. A record that has got more fields (`Extended`) is written
without the last ones that have their defaults, so that artefacts which do not use them keep their bytes. The reader
fills the defaults in, and `artefact.unpack` refuses bytes in which they are written out.
"""

from functools import cache
from typing import Any, get_args, get_type_hints

import msgspec

from rtshcua.model.flat.struct import Extended


def builtins_of(part: msgspec.Struct) -> Any:
    """The integers, texts, octets and lists of a struct."""
    made = msgspec.to_builtins(part, builtin_types=(bytes,))
    _shorten(part, made)
    return made


def _shorten(part: msgspec.Struct, made: Any) -> None:
    """Remove trailing defaults in `made`, of `part` and of all within it."""
    for number, name in _extended(type(part)):
        value, inner = getattr(part, name), made[number]
        if isinstance(value, tuple):
            for each, its in zip(value, inner, strict=True):
                _shorten(each, its)
        else:
            _shorten(value, inner)
    if isinstance(part, Extended):
        defaults = type(part).__struct_defaults__
        names = type(part).__struct_fields__
        while len(made) > part.LEAST and getattr(part, names[len(made) - 1]) == defaults[len(made) - len(names) - 1]:
            made.pop()


@cache
def _extended(kind: type[msgspec.Struct]) -> tuple[tuple[int, str], ...]:
    """The fields of a struct, by number and name, that are or hold records of a kind that may be shortened."""
    hints = get_type_hints(kind)
    return tuple(
        (number, name)
        for number, name in enumerate(kind.__struct_fields__)
        if any(issubclass(each, Extended) or _extended(each) for each in _structs(hints[name]))
    )


def _structs(hint: Any) -> list[type[msgspec.Struct]]:
    """The struct types in the type of a field."""
    if isinstance(hint, type) and issubclass(hint, msgspec.Struct):
        return [hint]
    return [each for part in get_args(hint) for each in _structs(part)]
