"""The frame of every CBOR artefact: the array of format name, integer version and body.

An array, not a map: the bytes then really begin with name and version, whatever the body's keys sort like.
"""

from typing import TypeVar

import msgspec

from rtshcua.wire import cbor, names
from rtshcua.wire.cbor import CborError, Value
from rtshcua.wire.names import Artefact
from rtshcua.wire.untrusted import Untrusted

_S = TypeVar("_S", bound=msgspec.Struct)


class ArtefactError(Untrusted):
    """Bytes that are no such artefact: `malformed`, `unknown-format`, `unknown-version`."""


def wrap(artefact: Artefact, body: object) -> bytes:
    """The canonical bytes of an artefact. Raises `CborError` for a body that has none."""
    return cbor.encode((artefact.name, artefact.version, body))


def unwrap(artefact: Artefact, data: bytes) -> Value:
    """The body of `data`, which must be this very artefact in this very version. Raises `ArtefactError`."""
    try:
        value = cbor.decode(data)
    except CborError as error:
        raise ArtefactError("malformed", f"this is no `{artefact.name}`: not canonical CBOR: {error}") from None
    match value:
        case (str(name), int(version), body) if type(version) is int:
            if name != artefact.name:
                raise ArtefactError("unknown-format", f"this is `{name[:80]}`, not `{artefact.name}`")
            if version != artefact.version:
                text = f"`{name}` version {version} is unknown here; only version {artefact.version} is read"
                older = f"; {names.COMPATIBILITY} says what reads earlier ones" if version < artefact.version else ""
                raise ArtefactError("unknown-version", text + older)
            return body
    raise ArtefactError("malformed", f"this is no `{artefact.name}`: not an array of format name, version and body")


def pack(artefact: Artefact, body: msgspec.Struct) -> bytes:
    """The canonical bytes of an artefact whose body is a struct."""
    return wrap(artefact, msgspec.to_builtins(body, builtin_types=(bytes,)))


def unpack(artefact: Artefact, data: bytes, shape: type[_S], error: type[Untrusted], what: str) -> _S:
    """The body of `data`, a struct, provided that `pack` gives `data` of it. Raises `error`, slug `malformed`, with
    `what` it is not, and `ArtefactError`.
    """
    try:
        body = msgspec.convert(unwrap(artefact, data), shape, builtin_types=(bytes,))
    except msgspec.ValidationError as invalid:
        raise error("malformed", f"not a {what}: {invalid}") from None
    if pack(artefact, body) != data:
        raise error("malformed", f"not the bytes that this {what} encodes to")
    return body
