"""The frame of every CBOR artefact: an array of format name, integer version and body.

It is an array and not a map, so that the bytes begin with name and version, independent of the sort order of keys.
"""

from typing import Final, TypeVar, cast

import msgspec

from rtshcua.wire import cbor, names
from rtshcua.wire.builtins import builtins_of
from rtshcua.wire.cbor import CborError, Value
from rtshcua.wire.names import Artefact
from rtshcua.wire.untrusted import Untrusted

_S = TypeVar("_S", bound=msgspec.Struct)
_NEGATIVE, _TEXT, _ARRAY = 1, 3, 4  # major types (RFC 8949, section 3.1)
_INT64_MAX: Final = (1 << 63) - 1


class ArtefactError(Untrusted):
    """Bytes that are not the expected artefact: `malformed`, `unknown-format`, `unknown-version`."""


def wrap(artefact: Artefact, body: object) -> bytes:
    """The canonical bytes of an artefact. Raises `CborError` for a body that cannot be encoded."""
    return cbor.encode((artefact.name, artefact.version, body))


def unwrap(artefact: Artefact, data: bytes, *, items: int = 0) -> Value:
    """The body of `data`, which must be this artefact in this version. Raises `ArtefactError`.

    `items` limits the CBOR items of unverified data whose format has no limit of its own. Name and version are
    checked before the rest is decoded.
    """
    claimed = _claimed(data)
    if claimed is not None:
        name, version = claimed
        if name != artefact.name.encode():
            said = name[:80].decode("utf-8", "replace")
            raise ArtefactError("unknown-format", f"expected `{artefact.name}`, found `{said}`")
        if version != artefact.version:
            text = (
                f"`{artefact.name}` version {version} is not supported; this program reads version {artefact.version}"
            )
            older = f"; see {names.COMPATIBILITY} for earlier versions" if version < artefact.version else ""
            raise ArtefactError("unknown-version", text + older)
    try:
        value = cbor.decode(data, items=artefact.items or items or cbor.LIMIT)
    except CborError as error:
        raise ArtefactError("malformed", f"not a `{artefact.name}`: not canonical CBOR: {error}") from None
    if claimed is None:
        raise ArtefactError("malformed", f"not a `{artefact.name}`: expected an array of format name, version and body")
    return cast("tuple[Value, ...]", value)[2]


def _claimed(data: bytes) -> tuple[bytes, int] | None:
    """The name and the version at the beginning of the bytes; None if they do not begin as an artefact."""
    try:
        array, count, at = cbor.head(data, 0)
        text, size, start = cbor.head(data, at)
        if (array, count, text) != (_ARRAY, 3, _TEXT) or size > len(data) - start:
            return None
        integer, argument, _ = cbor.head(data, start + size)
    except CborError:
        return None
    if integer > _NEGATIVE or argument > _INT64_MAX:
        return None
    return data[start : start + size], ~argument if integer == _NEGATIVE else argument


def pack(artefact: Artefact, body: msgspec.Struct) -> bytes:
    """The canonical bytes of an artefact whose body is a struct."""
    return wrap(artefact, builtins_of(body))


def unpack(
    artefact: Artefact, data: bytes, shape: type[_S], error: type[Untrusted], what: str, *, items: int = 0
) -> _S:
    """The body of `data`, a struct, provided that `pack` encodes it to `data`. `items` is as for `unwrap`. Raises
    `ArtefactError`, and `error` with slug `malformed` and `what` was expected.
    """
    try:
        body = msgspec.convert(unwrap(artefact, data, items=items), shape, builtin_types=(bytes,))
    except msgspec.ValidationError as invalid:
        raise error("malformed", f"not a {what}: {invalid}") from None
    if pack(artefact, body) != data:
        raise error("malformed", f"not the bytes that this {what} encodes to")
    return body
