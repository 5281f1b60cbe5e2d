"""Who signs the log of a run: this process, or a boundary of its own process, which then has the key alone."""

from collections.abc import Callable

from rtshcua.app.fly.refused import Refused
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.wire.keys import Duty, SigningKey, VerificationKey


class LogSigner:
    """The log's key, until it is handed over. `kid` names it, and `public` is its public half; there may be no more of
    it here.
    """

    def __init__(self, key: SigningKey | VerificationKey) -> None:
        self._key: SigningKey | None = None
        self._elsewhere: Callable[[bytes], bytes | Refusal] | None = None
        self.use(key)

    def use(self, key: SigningKey | VerificationKey) -> None:
        """This process signs, with this key, if it has it."""
        self.kid, self.public = key.kid, key.public
        self._key, self._elsewhere = (key if isinstance(key, SigningKey) else None), None

    def hand_over(self, elsewhere: Callable[[bytes], bytes | Refusal]) -> None:
        """Who has the key too signs from now on; it is let go here."""
        self._key, self._elsewhere = None, elsewhere

    def key(self) -> SigningKey:
        """The key. Raises LookupError once it was handed over, and where it never was here."""
        if self._key is None:
            raise LookupError("the log's key is not here")
        return self._key

    def sign(self, checkpoint: bytes) -> bytes:
        """The signature under a checkpoint. Raises `Refused` where the boundary does not sign it."""
        if self._elsewhere is None:
            return self.key().sign(checkpoint, duty=Duty.LOG)
        signed = self._elsewhere(checkpoint)
        if isinstance(signed, Refusal):
            text = f"the boundary's process does not sign the log: {signed.text} ({signed.slug})"
            raise Refused(ExitCode.REFUSED, f"boundary-{signed.slug}", text)
        return signed
