"""The structs of boundary/model/flat.h as ctypes, read from the header itself, and their comparison with Python's.

A struct of the flat form has the same field names in both. In C a tuple is a table with a count beside it, or a list: a
view into the bytes; an optional field has a flag `has_...`.
"""

import ctypes
import re
from pathlib import Path
from typing import Any

import msgspec

from rtshcua.wire import cbor

BOUNDARY = Path(__file__).resolve().parents[2] / "boundary"


class Bytes(ctypes.Structure):
    _fields_ = [("at", ctypes.c_void_p), ("size", ctypes.c_uint32)]

    def octets(self) -> bytes:
        return ctypes.string_at(self.at, self.size)


class List(ctypes.Structure):
    _fields_ = [("at", ctypes.c_void_p), ("end", ctypes.c_void_p), ("count", ctypes.c_uint32)]


def structs() -> dict[str, Any]:
    """Every struct of the header by its name."""
    limits = (BOUNDARY / "model" / "limits.h").read_text()
    sizes = {name: int(value) for name, value in re.findall(r"#define (RT_MAX\w+) (\d+)", limits)}
    text = re.sub(r"/\*.*?\*/", "", (BOUNDARY / "model" / "flat.h").read_text(), flags=re.DOTALL)
    found: dict[str, Any] = {
        "rt_bytes": Bytes, "rt_list": List, "bool": ctypes.c_bool, "int64_t": ctypes.c_int64,
        "uint32_t": ctypes.c_uint32, "uint8_t": ctypes.c_uint8, "const rt_approval *": ctypes.c_void_p,
    }  # fmt: skip
    for body, name in re.findall(r"typedef struct \{(.*?)\} (\w+);", text, re.DOTALL):
        fields = []
        for kind, names in re.findall(r"(const rt_approval \*|\w+)\s*([^;]+);", body):
            for field in re.split(r",\s*", names):
                label, _, size = field.strip().rstrip("]").partition("[")
                fields.append((label, found[kind] * sizes[size] if size else found[kind]))
        found[name] = type(name, (ctypes.Structure,), {"_fields_": fields})
    return found


def differences(here: Any, there: Any, path: str = "") -> list[str]:
    """The fields that differ between a Python value and its reading in C."""
    if isinstance(there, Bytes):
        expected = here.encode() if isinstance(here, str) else here
        return [] if there.octets() == expected else [path]
    if isinstance(there, List):
        encoded = cbor.encode(msgspec.to_builtins(here, builtin_types=(bytes,)))
        items = ctypes.string_at(there.at, (there.end or 0) - (there.at or 0))
        return (
            []
            if there.count == len(here) and cbor.encode([0] * len(here))[: -len(here) or None] + items == encoded
            else [path]
        )
    if not isinstance(there, ctypes.Structure):
        return [] if here == there else [path]
    found = []
    names = {name for name, *_ in there._fields_}
    for name in here.__struct_fields__:
        value, at = getattr(here, name), f"{path}.{name}"
        if f"has_{name}" in names and getattr(there, f"has_{name}") is not (value is not None):
            found.append(f"{at}?")
        elif value is not None or f"has_{name}" not in names:
            read = getattr(there, name)
            if isinstance(read, ctypes.Array):
                count = next(getattr(there, each) for each in (f"{name[:-1]}_count", f"{name}_count") if each in names)
                pairs = zip(value, read, strict=False)
                found += [f"{at} count"] * (count != len(value))
                found += [each for i, pair in enumerate(pairs) for each in differences(*pair, f"{at}[{i}]")]
            else:
                found += differences(value, read, at)
    return found
