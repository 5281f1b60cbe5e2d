"""`--signing-key`: one link's key, taken from its file, put to use, and its timestamps kept while it is used."""

from pathlib import Path

from rtshcua.adapters.clock import LinkClock
from rtshcua.adapters.store.signing import IN_USE, LinkKeeper, LinkKeyError, LinkStore, fingerprint, read_link_key
from rtshcua.mavlink.radio import UnsignedRadio
from rtshcua.mavlink.signing import Counts, FrameVerifier, SignedLink, SigningState
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.onboard.enforcement.isolated import IsolatedGate
from rtshcua.onboard.rehearsal import unheard

_RADIO = "the policy reads RADIO_STATUS, which radios do not sign: it is not known without `--unsigned-radio`"
_OUTDATED = (
    "Either they are repeated, or the vehicle's signing clock is behind; our heartbeat goes out and sets it. If the "
    "vehicle does not hear us here, connect over a cable for a moment: "
    "`rtshcua doctor --connect serial:DEVICE:BAUD --signing-key FILE`"
)
_STRANGE = (
    "`{}` is not this user's own file, so no memory is used: after a kill, frames of the last second could be heard "
    "again; remove it before the flight"
)
#: messages that nobody signs
_UNSIGNED = frozenset({"RADIO_STATUS"})


class LinkSigning:
    """Signs what `frames` lets out to a vehicle, and verifies what comes in. Without a key it does neither.

    `state` is the folder where timestamps are kept, by the vehicle's identity. Raises LinkKeyError, and OSError where
    they cannot be; `even_damaged`, that waits in `damage` until it is known whether the vehicle flies, for what flies
    must come down: it signs by this machine's time meanwhile, and hears nothing older than a minute. `unheard` holds
    the slots of the signals that cannot come, for nobody signs what carries them.
    """

    def __init__(
        self, key_file: Path | None, policy: Policy, frames: FrameSession | IsolatedGate, state: Path, clock: LinkClock,
        *, unsigned_radio: bool, even_damaged: bool = False,
    ) -> None:  # fmt: skip
        self.damage: LinkKeyError | OSError | None = None
        self.verifier: FrameVerifier | None = None
        self.trouble: str | None = None
        self.notes: list[str] = []
        self.unheard: frozenset[int] = frozenset()
        self.name: bytes | None = None  # the fingerprint of the key
        self._counts: Counts | None = None
        self._keeper: LinkKeeper | None = None
        if key_file is None:
            return
        key = read_link_key(key_file)
        self.name = bytes.fromhex(fingerprint(key))
        now, link, store = clock.now(), None, None
        try:
            store = LinkStore(state, policy.vehicle.identity, key)
            link = SignedLink(key, store.load(), now.utc_us, now.monotonic_us)
            self._keeper = LinkKeeper(store, link, clock.us_in)
            strange = store.heard.refused
            if strange is not None:
                self.notes.append(_STRANGE.format(strange))
        except (LinkKeyError, OSError) as error:
            if store is not None:
                store.close()
            if not even_damaged or (isinstance(error, LinkKeyError) and error.slug == IN_USE):
                raise
            self.damage = error
        if link is None:
            link = SignedLink(key, SigningState(0, {}), now.utc_us, now.monotonic_us)
        assert isinstance(frames, FrameSession)
        frames.sign_with(link)
        self._counts = link.counts
        self._hear(link, policy, unsigned_radio=unsigned_radio)

    def elsewhere(self, name: bytes, gate: IsolatedGate, policy: Policy, *, unsigned_radio: bool) -> None:
        """A boundary elsewhere has the key of this name: it signs and verifies, and keeps the timestamps."""
        self.name, self._counts = name, gate.counts
        self._hear(gate, policy, unsigned_radio=unsigned_radio)

    def _hear(self, link: FrameVerifier, policy: Policy, *, unsigned_radio: bool) -> None:
        self.verifier = UnsignedRadio(link) if unsigned_radio else link
        read = {source.message for signal in policy.signals for source in signal.sources}
        if not unsigned_radio:
            self.unheard = unheard(policy, _UNSIGNED)
            if not read.isdisjoint(_UNSIGNED):
                self.notes.append(_RADIO)

    @property
    def rejected(self) -> str | None:
        """What came and was not believed, in words, while nothing else came; None if nothing did."""
        counts = self._counts
        if counts is None or counts.accepted:
            return None
        why = (
            (counts.forged, "signed with another key"),
            (counts.unsigned, "not signed"),
            (counts.stale, "older than what was heard before, or than a minute"),
            (counts.strayed + counts.crowded, "of another link"),
        )
        told = ", ".join(f"{count} {what}" for count, what in why if count)
        if counts.stale:
            told += f". {_OUTDATED}"
        return f"frames come, and none is believed: {told}" if told else None

    def close(self) -> None:
        """Keep the last timestamps. What went wrong with keeping them is in `trouble`, for a person."""
        if self._keeper is None:
            return
        self._keeper.close()
        error = self._keeper.trouble
        if error is not None:
            reason = (error.strerror or str(error)).lower()
            self.trouble = (
                f"the link's timestamps could not be kept: {reason}; it needs a new key before the next flight"
            )
