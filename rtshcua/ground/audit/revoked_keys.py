"""Checks a log for keys that newer trust roots revoke. The auditor supplies these roots.

A log carries the trust root of its time and is verified with that root; it cannot contain later revocations. A key is
revoked when the first root that lists it as revoked is issued. What the key signed

- before that is valid, and the report says that the key was revoked since;
- after that is not trusted: the vehicle did not have the newer root, or another holder of the key signed it;
- at a time that may be before or after makes the log incomplete.

The log key vouches for the times of a log. If the log key was revoked, the times prove nothing: the log is incomplete,
unless witnesses cosigned its end before the revocation. A trust root that a revoked root key signed is accepted only if
the auditor supplies this root.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Final, NamedTuple

from rtshcua.evidence.finding import Claim, Finding
from rtshcua.evidence.log_writer import BOUNDARY
from rtshcua.evidence.note import octets
from rtshcua.evidence.records import AnyRecord, Effect, Genesis
from rtshcua.evidence.report import LogReport, utc_of
from rtshcua.ground.audit.audit import Audit, failing
from rtshcua.ground.audit.documents import DOCUMENT_KINDS
from rtshcua.wire import cose
from rtshcua.wire.bundle import MAX_BUNDLE, envelopes
from rtshcua.wire.document import MAX_DOCUMENT
from rtshcua.wire.trust import MAX_ROOT, TrustRoot, follow, open_root
from rtshcua.wire.untrusted import Untrusted

_S: Final = 1_000_000  # us


class Revocation(NamedTuple):
    """The version of the root that revoked a key, and the earliest and latest time of the revocation."""

    version: int
    early_us: int
    late_us: int


class KeyUse(NamedTuple):
    """What a key signed, in which record, and the earliest and latest time; `document` means a document in flight."""

    what: str
    kid: bytes
    record: int
    early_us: int
    late_us: int
    document: bool = False


class RevokedKeys:
    """Checks the records of an audited log against signed trust roots, given in any order.

    Each root is trusted because the auditor supplies it. Raises `Untrusted` for data that is not a trust root.
    """

    def __init__(self, roots: Iterable[bytes]) -> None:
        self._roots = {signed: _opened(signed) for signed in roots}
        self._documents: list[KeyUse] = []
        self._statements: dict[bytes, KeyUse] = {}  # the last one of each boundary key
        self._read = False

    def take(self, record: AnyRecord) -> None:
        """Add a valid record. The audit verifies the document or statement in it."""
        self._read = True
        if not self._roots or not isinstance(record, Effect) or record.event not in (*DOCUMENT_KINDS, BOUNDARY):
            return
        with suppress(Untrusted):
            kid = _signer(octets(record.detail) or b"", MAX_DOCUMENT)
            times = _between(record.utc_us, record.utc_error_us)
            if record.event == BOUNDARY:
                self._statements[kid] = KeyUse("what the boundary made", kid, record.seq, *times)
                return
            self._documents.append(KeyUse(f"the {record.event}", kid, record.seq, *times, document=True))

    def judged(self, audit: Audit) -> Audit:
        """Return the audit with the revocations applied. A failed audit is returned unchanged."""
        report, basis, genesis = audit.report, audit.basis, audit.report.genesis
        if report.failure is not None or basis is None or genesis is None:
            return audit
        signed = octets(genesis.root)
        assert signed is not None
        own = basis.root
        given = {data: root for data, root in self._roots.items() if data != signed}
        revoked = _revocations(tuple(given.values()), own)
        if not revoked and all(root.version <= own.version for root in given.values()):
            return audit  # no newer root was supplied
        flaw = self._unknown_root(signed, revoked) or next(_after(self._uses(genesis), revoked), None)
        if flaw is not None:
            return audit._replace(report=failing(report, flaw))
        proven: list[Claim] = []
        unproven, doubts = self._later_revocations(report, genesis, own, revoked)
        if not unproven and not doubts:
            proven, unproven = _lineage(signed, given, " and documents" * self._read)
        shortfall = report.shortfall or next(iter(doubts), None)
        unproven += [Claim(each.slug, each.text) for each in doubts if each is not shortfall]
        proven, unproven = [*report.proven, *proven], [*report.unproven, *unproven]
        report = report._replace(proven=tuple(proven), unproven=tuple(unproven), shortfall=shortfall)
        return audit._replace(report=report)

    def _uses(self, genesis: Genesis) -> list[KeyUse]:
        """What the keys of a trusted log signed, beginning with the log key."""
        data = octets(genesis.bundle)
        assert data is not None
        policy, mission = envelopes(data)
        times = _between(genesis.utc_us, genesis.utc_error_us)
        return [
            KeyUse("the log", bytes.fromhex(genesis.log_kid), 0, *times),
            KeyUse("the policy", _signer(policy, MAX_BUNDLE), 0, *times),
            KeyUse("the mission", _signer(mission, MAX_BUNDLE), 0, *times),
            *self._statements.values(),
            *self._documents,
        ]

    def _unknown_root(self, signed: bytes, revoked: Mapping[bytes, Revocation]) -> Finding | None:
        kid = _signer(signed, MAX_ROOT)
        by = revoked.get(kid)
        if by is None or signed in self._roots:
            return None
        text = (
            f"{_by(kid, by)}, and it signed the log's trust root, which is not among the supplied roots: a holder of "
            "the key can sign a root for any log"
        )
        return Finding("trust/root-revoked-key", 0, text, kid.hex())

    def _later_revocations(
        self, report: LogReport, genesis: Genesis, own: TrustRoot, revoked: Mapping[bytes, Revocation]
    ) -> tuple[list[Claim], list[Finding]]:
        """Return claims about keys that were revoked after they signed, and findings about those that are uncertain."""
        later: list[Claim] = []
        doubts: list[Finding] = []
        for use in self._uses(genesis):
            by = revoked.get(use.kid)
            if by is None:
                continue
            is_log_key = use.kid.hex() == genesis.log_kid
            late_us = _witnessed_us(report, own, revoked) if is_log_key else use.late_us
            if late_us is not None and late_us < by.early_us:
                later.append(
                    Claim("revoked", f"that nobody else held the key that signed {use.what}: {_by(use.kid, by)}")
                )
            elif is_log_key:
                text = f"{_by(use.kid, by)}, and no witness cosigned {use.what} before that: its times prove nothing"
                doubts.append(Finding("trust/revoked-log-key", use.record, text, use.kid.hex()))
            else:
                text = f"{_by(use.kid, by)} or earlier, and it signed {use.what}, before or after that"
                doubts.append(Finding("trust/revoked-when", use.record, text, use.kid.hex()))
        return later, doubts


def _opened(signed: bytes) -> TrustRoot:
    return open_root(signed, pinned=_signer(signed, MAX_ROOT), now_us=0)


def _signer(envelope: bytes, limit: int) -> bytes:
    return cose.unverified(envelope, limit=limit).kid


def _between(utc_us: int, error_us: int) -> tuple[int, int]:
    return utc_us - error_us, utc_us + error_us


def _revocations(roots: Sequence[TrustRoot], own: TrustRoot) -> dict[bytes, Revocation]:
    """Return the keys that these roots revoke and the log's own root does not, with the times of revocation.

    A missing version in between makes the earliest time inexact. If the log's own root is not older than the revoking
    one, the key counts as revoked from the beginning.
    """
    found: dict[bytes, Revocation] = {}
    for root in sorted(roots, key=lambda each: each.version):
        for kid in root.revocations - own.revocations - found.keys():
            before = [each for each in (own, *roots) if each.version < root.version and kid not in each.revocations]
            if own not in before:
                found[kid] = Revocation(root.version, 0, 0)
                continue
            last = max(before, key=lambda each: each.version)
            exact = last.version == root.version - 1
            found[kid] = Revocation(root.version, root.issued_at_us if exact else last.issued_at_us, root.issued_at_us)
    return found


def _after(uses: Iterable[KeyUse], revoked: Mapping[bytes, Revocation]) -> Iterator[Finding]:
    """Yield a finding for each use of a key after its revocation."""
    for use in uses:
        by = revoked.get(use.kid)
        if by is not None and use.early_us >= by.late_us:
            slug = "document/revoked-key" if use.document else "trust/revoked-key"
            text = f"{_by(use.kid, by)}, and it signed {use.what} after that: the vehicle did not have this root"
            yield Finding(slug, use.record, text, use.kid.hex())


def _witnessed_us(report: LogReport, own: TrustRoot, revoked: Mapping[bytes, Revocation]) -> int | None:
    """The time when enough witnesses, without revoked ones, had cosigned the end of a log; None if too few did."""
    if report.outside is None:
        return None
    gone = {key.public for key in own.keys if key.kid in revoked}
    saw = [seen for seen in report.outside.witnessed if seen.size + 1 >= report.records and seen.public not in gone]
    times = sorted(seen.time_s for seen in saw)[: report.outside.threshold]
    return (times[-1] + 1) * _S if len(times) == report.outside.threshold else None


def _by(kid: bytes, by: Revocation) -> str:
    when = f" of {utc_of(by.late_us // _S)}" if by.late_us else ""
    return f"key {kid.hex()} was revoked by root version {by.version}{when}"


def _lineage(signed: bytes, roots: Mapping[bytes, TrustRoot], also: str) -> tuple[list[Claim], list[Claim]]:
    """Return the claim, proven or unproven, that the newest root succeeds the log's root and revokes no key of it."""
    chain = sorted(roots, key=lambda data: roots[data].version)
    newest = roots[chain[-1]]
    try:
        follow(chain, current=signed, now_us=0)
    except Untrusted as error:
        text = f"that root version {newest.version} succeeds the log's root: {error}"
        return [], [Claim("revocations", text)]
    text = f"root version {newest.version} of {utc_of(newest.issued_at_us // _S)} revokes none of the keys that "
    text += f"signed the log, the policy, the mission{also}"
    return [Claim("revocations", text)], []
