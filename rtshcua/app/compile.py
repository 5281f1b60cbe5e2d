"""The service `compile`: check a mission and its claims, and sign it into a bundle."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from rtshcua.adapters.store.keystore import PROPOSERS, KeyStore
from rtshcua.app.pictures import DrawnMissions, unfit_picture, write_picture
from rtshcua.app.programs import compile_sources, meant, no_source
from rtshcua.app.signing_keys import check_trusted, strangers
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.span import Source
from rtshcua.ground.pipeline.pins import Pins, undeclared
from rtshcua.ground.pipeline.program import Compiled
from rtshcua.ground.pipeline.sign import sign
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.wire.keys import SigningKey


class CompileRequest(NamedTuple):
    """A source, further sources, the mission with its parameter values, its allowed claims (`pins`), the path of the
    bundle, by default beside the source with the `suffix`, and that of a picture. `as_json` means that standard output
    has an object.
    """

    source: Path
    further: Sequence[Path]
    output: Path | None
    suffix: str
    pins: Pins
    issued_at_us: int
    mission: str | None = None
    values: Sequence[str] = ()
    picture: Path | None = None
    as_json: bool = False


class CompileResult(NamedTuple):
    """The compiled mission, the diagnostics for the author of the sources, the sources, and the path of the bundle."""

    compiled: Compiled
    diagnostics: tuple[Diagnostic, ...]
    sources: Mapping[str, Source]
    target: Path

    @property
    def to_sign(self) -> tuple[Policy, Mission]:
        """The policy and the mission of sources without errors."""
        assert self.compiled.policy is not None
        assert self.compiled.mission is not None
        return self.compiled.policy, self.compiled.mission


class SignedBundle(NamedTuple):
    """A bundle, the keys that signed its policy and mission, and warnings about keys that the trust root rejects."""

    data: bytes
    signers: tuple[SigningKey, SigningKey]
    warnings: list[str]


def claimed_pins(proposer: str | None, role: str | None, policy: str | None) -> Pins | Refusal:
    """The claims that a mission may make: its source, its role, and its policy as `NAME` or `NAME@VERSION`."""
    name, at, version = (policy or "").partition("@")
    numbered = version.isascii() and version.isdigit()
    if proposer not in (None, *PROPOSERS):
        return Refusal("usage", f"unknown source `{proposer}` in `--source`", f"accepted: {' or '.join(PROPOSERS)}")
    if (policy is not None and not name) or (at and not numbered):
        return Refusal("usage", f"`{policy}` in `--policy` is not a policy", "accepted: a name, or as in `rules@7`")
    return Pins(proposer, role, frozenset({name}) if name else None, int(version) if numbered else None)


def compile_mission(request: CompileRequest) -> CompileResult | Refusal:
    """Compile a mission; an unusable request, or a claim that no source declares, is refused."""
    given = [request.source, *request.further]
    refused = no_source(request.source)
    if refused is not None:
        return refused
    target = request.output or request.source.with_suffix(request.suffix)
    refused = _no_target(target, given) or _no_picture(request, target)
    if refused is not None:
        return refused
    compiled, sources = compile_sources(
        given, mission=request.mission, issued_at_us=request.issued_at_us, values=request.values, pins=request.pins
    )
    unknown = undeclared(request.pins, compiled.declared, compiled.diagnostics)
    return unknown or CompileResult(compiled, meant(compiled.diagnostics, sources, given), sources, target)


def draw(made: CompileResult, picture: Path) -> DrawnMissions | Refusal:
    """Write the picture of a mission, also if it is refused, as far as it is planned. Raises OSError."""
    from rtshcua.ground.report.mission_maps import CheckedMissions

    planned = () if made.compiled.planned is None else (made.compiled.planned,)
    return write_picture(picture, [CheckedMissions(made.sources, planned, made.diagnostics)], made.sources)


def sign_bundle(
    policy: Policy, mission: Mission, signers: tuple[SigningKey, SigningKey], store: KeyStore, issued_at_us: int
) -> SignedBundle:
    """Sign a bundle with a policy key and a mission key. Raises `Untrusted` for a key that may not sign it."""
    data = sign(policy, mission, policy_key=signers[0], mission_key=signers[1])
    check_trusted(store, signers[1], policy, mission)
    return SignedBundle(data, signers, strangers(store, signers, policy.vehicle.identity, issued_at_us))


def _no_picture(request: CompileRequest, bundle: Path) -> Refusal | None:
    """The refusal if the requested picture cannot be written."""
    if request.picture is None:
        return None
    if request.picture.resolve() == bundle.resolve():
        return Refusal("usage", f"`{bundle}` cannot be both the bundle and the picture", "name two files")
    return unfit_picture(request.picture, [request.source, *request.further], as_json=request.as_json)


def _no_target(target: Path, given: Sequence[Path]) -> Refusal | None:
    """The refusal if no bundle can be written to `target`."""
    if not target.parent.is_dir():
        return Refusal("output", f"there is no folder `{target.parent}` to write to", code=ExitCode.INPUT)
    if not target.exists() or (target.is_file() and not any(each.exists() and target.samefile(each) for each in given)):
        return None
    what = "one of the sources" if target.is_file() else "not a regular file"
    return Refusal("output", f"`{target}` is {what}, and is not overwritten by a bundle")
