"""A request that cannot be read is answered too: an editor waits for each of its requests."""

from typing import Any

from pygls.exceptions import JsonRpcException, JsonRpcInvalidParams
from pygls.protocol import LanguageServerProtocol


class Protocol(LanguageServerProtocol):
    """The protocol of pygls, which logs what it cannot read, and with an answer: -32602, `Invalid params`."""

    def structure_message(self, data: dict[str, Any]) -> Any:
        """A message; None for a request that was malformed, and is answered. Raises JsonRpcException for any other."""
        try:
            return super().structure_message(data)
        except JsonRpcException as error:
            asked, number = data.get("method"), data.get("id")
            if not isinstance(asked, str) or not isinstance(number, int | str):
                raise
            why = f"these are no parameters of `{asked}`"
            self._send_response(number, error=JsonRpcInvalidParams(message=why, data=str(error)).to_response_error())
            return None

    def handle_message(self, message: Any) -> None:
        """Hands a message to its feature, unless it is answered already."""
        if message is not None:
            super().handle_message(message)
