"""`--signing-key`: read the key of a link, sign and verify with it, and store its timestamps meanwhile."""

from pathlib import Path

from rtshcua.adapters.clock import LinkClock
from rtshcua.adapters.store.signing import IN_USE, LinkKeeper, LinkKeyError, LinkStore, fingerprint, read_link_key
from rtshcua.mavlink.radio import UnsignedRadio
from rtshcua.mavlink.signing import Counts, FrameVerifier, SignedLink, SigningState
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.onboard.enforcement.isolated import IsolatedGate
from rtshcua.onboard.rehearsal import unheard

_RADIO = "the policy reads RADIO_STATUS, which radios do not sign: its signals stay unknown without `--unsigned-radio`"
_OUTDATED = (
    "Either the frames are replayed, or the vehicle's signing clock is behind; our heartbeat goes out and sets "
    "it. If the "
    "vehicle does not hear us here, connect over a cable for a moment: "
    "`rtshcua doctor --connect serial:DEVICE:BAUD --signing-key FILE`"
)
_STRANGE = (
    "`{}` is not this user's own file, so it is not used: after a kill, frames of the last second could be accepted "
    "again; remove it before the flight"
)
#: messages that are never signed
_UNSIGNED = frozenset({"RADIO_STATUS"})


class LinkSigning:
    """Signs the frames that `frames` sends to a vehicle, and verifies received ones. Without a key it does neither.

    `state` is the folder of the timestamps, by the vehicle's identity. Raises LinkKeyError, and OSError if they cannot
    be read or stored. With `even_damaged` the error is kept in `damage` until it is known whether the vehicle flies,
    because a vehicle in the air must come down; meanwhile frames are signed by this machine's time, and frames older
    than a minute are rejected. `unheard` has the slots of signals whose messages are never signed.
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
            foreign_file = store.heard.refused
            if foreign_file is not None:
                self.notes.append(_STRANGE.format(foreign_file))
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
        self._set_verifier(link, policy, unsigned_radio=unsigned_radio)

    def elsewhere(self, name: bytes, gate: IsolatedGate, policy: Policy, *, unsigned_radio: bool) -> None:
        """Let a boundary process with the key of this name sign and verify. It stores the timestamps itself."""
        self.name, self._counts = name, gate.counts
        self._set_verifier(gate, policy, unsigned_radio=unsigned_radio)

    def _set_verifier(self, link: FrameVerifier, policy: Policy, *, unsigned_radio: bool) -> None:
        self.verifier = UnsignedRadio(link) if unsigned_radio else link
        read = {source.message for signal in policy.signals for source in signal.sources}
        if not unsigned_radio:
            self.unheard = unheard(policy, _UNSIGNED)
            if not read.isdisjoint(_UNSIGNED):
                self.notes.append(_RADIO)

    @property
    def rejected(self) -> str | None:
        """A description of the rejected frames; None if there were none, or a frame was accepted."""
        counts = self._counts
        if counts is None or counts.accepted:
            return None
        why = (
            (counts.forged, "signed with another key"),
            (counts.unsigned, "not signed"),
            (counts.stale, "older than an accepted frame, or than a minute"),
            (counts.strayed + counts.crowded, "of another link"),
        )
        text = ", ".join(f"{count} {what}" for count, what in why if count)
        if counts.stale:
            text += f". {_OUTDATED}"
        return f"frames arrive, but none is accepted: {text}" if text else None

    def close(self) -> None:
        """Store the last timestamps; an error is described in `trouble`."""
        if self._keeper is None:
            return
        self._keeper.close()
        error = self._keeper.trouble
        if error is not None:
            reason = (error.strerror or str(error)).lower()
            self.trouble = (
                f"the link's timestamps could not be stored: {reason}; the link needs a new key before the next flight"
            )
