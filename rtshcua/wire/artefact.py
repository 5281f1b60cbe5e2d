"""The frame of every CBOR artefact: the array of format name, integer version and body.

An array, not a map: the bytes then really begin with name and version, whatever the body's keys sort like.
"""

from rtshcua.wire import cbor
from rtshcua.wire.cbor import CborError, Value
from rtshcua.wire.names import Artefact
from rtshcua.wire.untrusted import Untrusted


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
                raise ArtefactError(
                    "unknown-version",
                    f"`{name}` version {version} is unknown here; only version {artefact.version} is read",
                )
            return body
    raise ArtefactError("malformed", f"this is no `{artefact.name}`: not an array of format name, version and body")
