"""`rtshcua keys`: make, list, replace and revoke signing keys, and the trust root."""

import hashlib
import json
import os
import re
import secrets
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from getpass import getpass
from pathlib import Path
from typing import Annotated, Final, Literal

import typer

from rtshcua.adapters.boundary_process import first_kept
from rtshcua.adapters.clock import SystemClock
from rtshcua.adapters.link_setup import LinkSetup, after_setup, carry_out
from rtshcua.adapters.store.folders import data_folder, state_folder
from rtshcua.adapters.store.keystore import OPERATOR, OWNER, PROPOSERS, KeyStore
from rtshcua.adapters.store.laying import appearing
from rtshcua.adapters.store.signing import LinkKeyError, fingerprint, read_link_key, write_link_key
from rtshcua.adapters.store.vehicle_records import RootStore
from rtshcua.adapters.store.writing import PRIVATE_FILE, PRIVATE_FOLDER, make_folder, write_new
from rtshcua.adapters.vehicle.address import Address, AddressError
from rtshcua.adapters.vehicle.address import parse as parse_address
from rtshcua.adapters.vehicle.transport import open_transport
from rtshcua.app.exit_codes import code_of, untrusted
from rtshcua.app.fly.connect import unopened
from rtshcua.app.fly.start_boundary import boundary_key as attested_key
from rtshcua.app.fly.vehicle_trust import HELPS, trust
from rtshcua.app.wording import utc
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.console import TerminalConsole
from rtshcua.front.cli.faults import fail, misaddressed, refuse, say
from rtshcua.front.cli.options.document_options import AsJson
from rtshcua.front.cli.options.flight_options import System
from rtshcua.front.cli.render.showing.keys import as_object, speaks
from rtshcua.front.cli.stdout import out, out_json, out_rendered
from rtshcua.front.cli.unlock import read_passphrase, unlock
from rtshcua.front.cli.width import columns, typed
from rtshcua.mavlink.signing import KEY_OCTETS
from rtshcua.wire.keys import ANY, SEED_BYTES, Duty, SigningKey, VerificationKey
from rtshcua.wire.trust import HUMAN, LINK_ID_BYTES, PERSON, TrustRoot, key_refusal, open_root
from rtshcua.wire.untrusted import Untrusted

#: where a project has its sources (`rtshcua init`)
_FOLDERS: Final = (Path(), Path("policies"), Path("missions"))
#: of more sources than these nothing is said: it is no project, or takes too long
_MOST: Final = 40


def warn_of_unknown(roles: Iterable[str]) -> None:
    """Say of roles that no policy here knows: a key in such a role signs nothing that anybody asks for. It is no error,
    for a policy may come later, or lie elsewhere.
    """
    known = _known()
    for role in sorted(set(roles) - known) if known else ():
        names = ", ".join(f"`{name}`" for name in sorted(known))
        say(f"warning: no policy here knows the role `{role}`; its roles are {names}")


def _known() -> set[str]:
    try:
        files = [path for folder in _FOLDERS for path in sorted(folder.glob("*.rts")) if path.is_file()]
    except OSError:
        return set()
    if not 0 < len(files) <= _MOST:
        return set()
    from rtshcua.app.programs import examine, programs

    return {
        role for each in programs(files) for lowered in examine(each.reading).policies for role in lowered.policy.roles
    }


app = typer.Typer(add_completion=False)

# the options that its commands share
Vehicles = Annotated[list[str] | None, typer.Option(help="the identity of a vehicle [default: any] (repeatable)")]
RootPassphrase = Annotated[Path | None, typer.Option(help="a file with the root key's passphrase")]
OwnPassphrase = Annotated[Path | None, typer.Option(help="a file with the passphrase to encrypt the new key with")]

_DAY_US = 86_400_000_000
_SHORTEST = 12  # characters of a passphrase
_MOST_WITNESSES = 16
_KEY_ID = re.compile(r"[0-9a-f]{8,32}")
_LINK_ID = re.compile(r"[0-9a-f]{16}")
#: what the name of a socket and of its unit may be, unescaped and within the length of a socket's address
_SERVED = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,79}")
_ROLE = re.compile(r"[A-Za-z_][A-Za-z0-9_.]{0,99}")
_NO_PASSPHRASE = f"encrypted keys need a passphrase of {_SHORTEST} characters or more, typed alike"


@app.callback()
def keys() -> None:
    """Make, list, replace and revoke signing keys, and the trust root."""


@app.command()
def init(
    if_missing: Annotated[bool, typer.Option("--if-missing", help="do nothing where there are keys already")] = False,
    development: Annotated[
        bool, typer.Option("--development/--encrypted", help="unencrypted keys for trying out, or encrypted ones")
    ] = True,
    days: Annotated[int, typer.Option(min=1, max=3660, help="how long the trust root is valid")] = 365,
    passphrase_file: Annotated[Path | None, typer.Option(help="a file with the passphrase to encrypt with")] = None,
    witnesses: Annotated[int, typer.Option(min=0, max=_MOST_WITNESSES, help="how many keys for witnesses")] = 1,
    witness_threshold: Annotated[
        int, typer.Option(min=1, max=_MOST_WITNESSES, help="how many of them must cosign what counts as anchored")
    ] = 1,
    role: Annotated[
        list[str] | None, typer.Option(help="a role that missions may be for [default: operator] (repeatable)")
    ] = None,
    policy: Annotated[
        list[str] | None,
        typer.Option(help="a policy that missions may be under; encrypted keys need one [default: any] (repeatable)"),
    ] = None,
    owner: Annotated[str, typer.Option("--approver", help="who may recall, and answer as operator")] = OWNER,
    as_json: AsJson = False,
) -> ExitCode:
    """Make a key for each duty, and the trust root that names them.

    There are two mission keys: one signs what agents propose, and nothing else, the other what people do. The approval
    key is one person's, and `rtshcua keys approver` makes those of others. A development
    root says so of itself: its keys lie unencrypted in your data folder, readable by you alone. A witness is worth
    something only away from the vehicle: move its key to where `rtshcua witness` runs, and the log's aboard.
    """
    store = KeyStore(data_folder())
    if store.exists():
        if if_missing:
            return _listed(store, as_json=as_json)
        text = f"there are keys already in `{store.folder}`"
        return fail(ExitCode.INPUT, text, "`rtshcua keys list` shows them", slug="exists")
    if witness_threshold > max(1, witnesses):
        return fail(
            ExitCode.USAGE, f"`--witness-threshold {witness_threshold}` is more than the {witnesses} of `--witnesses`"
        )
    misnamed = _misnamed(role or (), policy or ())
    if misnamed is not None:
        return misnamed
    if not PERSON.fullmatch(owner):
        return _no_person(owner)
    if not development and not policy:
        help = "`--policy NAME` names one: whoever may choose the policy may choose a laxer one"
        return fail(ExitCode.USAGE, "mission keys that are in earnest are for named policies", help)
    now_us = time.time_ns() // 1000
    try:
        passphrase = None if development else _new_passphrase(passphrase_file)
        if passphrase is None and not development:
            return fail(ExitCode.USAGE, _NO_PASSPHRASE)
        store.create(
            lambda: secrets.token_bytes(SEED_BYTES),
            development=development,
            passphrase=passphrase,
            now_us=now_us,
            expires_us=now_us + days * _DAY_US,
            witnesses=witnesses,
            witness_threshold=witness_threshold,
            roles=role or (OPERATOR,),
            policies=policy or (ANY,),
            approver=owner,
        )
    except Untrusted as error:
        return _refused(error)
    return _listed(store, as_json=as_json)


@app.command()
def approver(
    name: Annotated[str, typer.Argument(help="the person: lower-case letters, digits, `.`, `_`, `-`")],
    role: Annotated[str, typer.Option(help="the role in which they answer")],
    vehicle: Vehicles = None,
    passphrase_file: RootPassphrase = None,
    own_passphrase_file: OwnPassphrase = None,
    as_json: AsJson = False,
) -> ExitCode:
    """Make an approval key for one person in one role, and the next version of the trust root, which names it.

    The same name is the same person: where a rule asks two people, two keys of one name are one. Hand the key file
    over, and keep it nowhere else. Who pinned the root key trusts the new root too.
    """
    if not PERSON.fullmatch(name):
        return _no_person(name)
    if not _ROLE.fullmatch(role):
        return _no_name(role, "role")
    warn_of_unknown([role])
    return _added(
        Duty.APPROVAL,
        lambda key: key.verification(roles=(role,), sources=(HUMAN,), vehicles=tuple(vehicle or (ANY,)), person=name),
        passphrase_file,
        own_passphrase_file,
        as_json=as_json,
    )


@app.command()
def boundary(
    vehicle: Vehicles = None,
    passphrase_file: RootPassphrase = None,
    own_passphrase_file: OwnPassphrase = None,
    as_json: AsJson = False,
) -> ExitCode:
    """Make a key for the enforcement boundary, and the next version of the trust root, which names it.

    `init` makes one; this is for a trust root without one. From then on each flight signs with it what was decided,
    and a log without that signature does not verify.
    """
    return _added(
        Duty.BOUNDARY,
        lambda key: key.verification(vehicles=tuple(vehicle or (ANY,))),
        passphrase_file,
        own_passphrase_file,
        as_json=as_json,
    )


@app.command()
def provision(
    folder: Annotated[Path, typer.Argument(help="where the vehicle's folder is made: `/var/lib/rtshcua-boundary`")],
    vehicle: Annotated[str, typer.Option(metavar="IDENTITY", help="the vehicle's identity, which its folder is named")],
    signing_key: Annotated[Path | None, typer.Option(metavar="FILE", help="the key of its link, if it has one")] = None,
    log_key: Annotated[Path | None, typer.Option(help="the key that signs the log (the key store's)")] = None,
    boundary_key: Annotated[
        Path | None, typer.Option(help="the key that the enforcement boundary signs with (the key store's)")
    ] = None,
    passphrase_file: Annotated[Path | None, typer.Option(help="a file with the passphrase of these keys")] = None,
    again: Annotated[
        bool, typer.Option("--again", help="in place of a folder that was provisioned before, which flies no more")
    ] = False,
    as_json: AsJson = False,
) -> ExitCode:  # fmt: skip
    """Make the folder of a boundary that listens (`run --boundary-socket`): its keys, unlocked, and the trust root.

    The folder appears whole, readable by its owner alone, or not at all; one that is there is left alone. It goes to
    the user of the boundary, and these keys to nobody else aboard. It knows of no bundle that an earlier one opened: it
    flies none that was issued before it was made, and a second one needs `--again` and another boundary key.
    """
    place = folder / vehicle
    if _SERVED.fullmatch(vehicle) is None:
        text = f"`{visible(vehicle)}` names no socket that a boundary listens at"
        return fail(
            ExitCode.USAGE,
            text,
            "accepted: an identity of 1 to 80 letters, digits, `_`, `.` and `-`, not first `.` or `-`",
        )
    if os.path.lexists(place):
        text = f"there is a folder `{place}` already"
        return fail(ExitCode.REFUSED, text, "what is kept there is of a vehicle that flies: move it away, or only copy")
    store, now_us = KeyStore(data_folder()), time.time_ns() // 1000
    try:
        root = open_root(store.root(), pinned=store.pin(), now_us=now_us)
        log = unlock(store, Duty.LOG, path=log_key, passphrase_file=passphrase_file)
        named = root.keys_for(Duty.LOG).get(log.kid)
        slug = "unknown-key" if named is None else key_refusal(named, vehicle=vehicle, now_us=now_us)
        if slug is not None:
            text = f"the trust root lets no log key {log.kid.hex()} speak for `{vehicle}` now"
            return fail(ExitCode.UNTRUSTED, text, "`--log-key` gives one that it names", slug=slug)
        console = TerminalConsole("lines", data_folder(), passphrase_file)
        own = attested_key(root, vehicle, now_us, console.unlock, boundary_key)
        if isinstance(own, Refusal):
            return refuse(own)
        before = store.provisioned(vehicle)
        if before is not None and (not again or own is None or own.kid == before):
            return _provisioned_before(vehicle, own, again=again)
        link = None if signing_key is None else read_link_key(signing_key)
    except Untrusted as error:
        return _refused(error)
    except LinkKeyError as error:
        return fail(code_of(error.slug), str(error), error.help, slug=f"link-key-{error.slug}")
    seeds = {"log.seed": log.private.private_bytes_raw(), "root.pin": store.pin()}
    seeds |= {} if own is None else {"boundary.seed": own.private.private_bytes_raw()}
    seeds |= {} if link is None else {"link.key": link}
    make_folder(folder, mode=PRIVATE_FOLDER)
    store.provision(vehicle, b"" if own is None else own.kid)
    with _marked_only_if_made(store, vehicle, before), appearing(place) as fresh:
        for name, octets in seeds.items():
            write_new(fresh / name, octets.hex().encode() + b"\n", mode=PRIVATE_FILE)
        write_new(fresh / "root.trust", store.root(), mode=PRIVATE_FILE)
        kept = first_kept(now_us) if own is None else first_kept(now_us, own.public)
        write_new(fresh / "kept", kept, mode=PRIVATE_FILE)
    names = {"log_key": log.kid.hex(), "boundary_key": None if own is None else own.kid.hex()}
    names["link_key"] = None if link is None else fingerprint(link)
    if as_json:
        out_json(json.dumps({"vehicle": vehicle, "folder": str(place), "trust_root": root.version, **names}))
        return ExitCode.OK
    out(
        f"{place}: the boundary of `{vehicle}`, under trust root version {root.version}",
        f"  log key        {names['log_key']}",
        f"  boundary key   {names['boundary_key'] or 'none: the trust root names none for it'}",
        f"  link key       {names['link_key'] or 'none'}",
        "give it to the boundary's user: `chown -R rtshcua-boundary:` it, and keep these keys nowhere else aboard",
    )
    return ExitCode.OK


@contextmanager
def _marked_only_if_made(store: KeyStore, vehicle: str, before: bytes | None) -> Iterator[None]:
    """Where no folder could be made, it is remembered as it was `before` which one was."""
    try:
        yield
    except OSError:
        with suppress(OSError):
            store.provision_again(vehicle, before)
        raise


def _provisioned_before(vehicle: str, own: SigningKey | None, *, again: bool) -> ExitCode:
    """Why no second folder is made."""
    if not again or own is None:
        text = f"a folder for `{vehicle}` was provisioned before: a second one does not know which bundles that opened"
        help = "`--again` where that one is lost, and another boundary key: `rtshcua keys replace` makes it"
        return fail(ExitCode.REFUSED, text, help, slug="provisioned-before")
    text = f"the folder of `{vehicle}` before has the boundary key {own.kid.hex()} too: no log would tell them apart"
    help = f"`rtshcua keys replace {own.kid.hex()[:8]}` makes another, and revokes it"
    return fail(ExitCode.REFUSED, text, help, slug="same-instance")


@app.command()
def mission(
    source: Annotated[str, typer.Argument(metavar="agent|operator", help="who proposes what it signs")],
    role: Annotated[list[str], typer.Option(help="a role that missions are for (repeatable)")],
    policy: Annotated[list[str], typer.Option(help="a policy that missions are under (repeatable)")],
    vehicle: Vehicles = None,
    passphrase_file: RootPassphrase = None,
    own_passphrase_file: OwnPassphrase = None,
    as_json: AsJson = False,
) -> ExitCode:
    """Make a mission key for one source, bound to roles and policies, and the next version of the trust root.

    `rtshcua compile` signs with the first key of the store that may, or with that of `--mission-key FILE`.
    """
    if source not in PROPOSERS:
        return fail(ExitCode.USAGE, f"`{source}` proposes no missions", f"accepted: {' or '.join(PROPOSERS)}")
    misnamed = _misnamed(role, policy)
    if misnamed is not None:
        return misnamed
    warn_of_unknown(each for each in role if each != ANY)
    return _added(
        Duty.MISSION,
        lambda key: key.verification(
            roles=tuple(role), sources=(source,), vehicles=tuple(vehicle or (ANY,)), policies=tuple(policy)
        ),
        passphrase_file,
        own_passphrase_file,
        as_json=as_json,
    )


@app.command()
def revoke(
    key: Annotated[
        list[str] | None, typer.Argument(metavar="KEY", help="its id, or the first 8 digits, or the name of its file")
    ] = None,
    link: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ID", help="the key of a link: what `rtshcua keys link` printed, or its file (repeatable)"
        ),
    ] = None,
    passphrase_file: RootPassphrase = None,
    as_json: AsJson = False,
) -> ExitCode:
    """Make the next version of the trust root, by which keys are never trusted again.

    A vehicle refuses what they sign from when it accepts that root: `rtshcua keys accept`, or its next flight under it.
    """

    def revoked(store: KeyStore, root: TrustRoot, signer: SigningKey, now_us: int) -> ExitCode | None:
        names = []
        for text in key or ():
            found = _named(store, root, text)
            if isinstance(found, ExitCode):
                return found
            if found.duty is Duty.ROOT:
                return fail(ExitCode.USAGE, "a root key is not revoked alone", "`rtshcua keys rotate-root` changes it")
            names.append(found.kid)
        for text in link or ():
            name = _link_named(text)
            if name is None:
                return fail(ExitCode.USAGE, f"`{text}` is no link key", "accepted: 16 hexadecimal digits, or its file")
            if name in root.revocations:
                return _revoked_already(text)
            names.append(name)
        if not names:
            return fail(ExitCode.USAGE, "no key was named", "`rtshcua keys list` shows them")
        store.revoke(names, signer=signer, now_us=now_us)
        return None

    return _succeeded(revoked, passphrase_file, as_json=as_json)


@app.command(name="replace")
def replace_(
    key: Annotated[str, typer.Argument(help="its id, or the first 8 digits, or the name of its file")],
    passphrase_file: RootPassphrase = None,
    own_passphrase_file: OwnPassphrase = None,
    as_json: AsJson = False,
) -> ExitCode:
    """Revoke a key, and make another that may speak for the same: an agent's, an approver's, a vehicle's log key.

    The old file is set aside. Hand the new one to whoever had it, and the trust root to the vehicles.
    """

    def replaced(store: KeyStore, root: TrustRoot, signer: SigningKey, now_us: int) -> ExitCode | None:
        found = _named(store, root, key)
        if isinstance(found, ExitCode):
            return found
        if found.duty is Duty.ROOT:
            return fail(ExitCode.USAGE, "a root key has its own command", "`rtshcua keys rotate-root` changes it")
        own = _own_passphrase(root, own_passphrase_file)
        if own is False:
            return fail(ExitCode.USAGE, _NO_PASSPHRASE)
        seed = secrets.token_bytes(SEED_BYTES)
        store.renew(found.kid, seed, passphrase=own or None, signer=signer, now_us=now_us)
        return None

    return _succeeded(replaced, passphrase_file, as_json=as_json)


@app.command()
def rotate_root(
    days: Annotated[
        int | None, typer.Option(min=1, max=3660, help="how long the new root is valid [default: as the old one]")
    ] = None,
    passphrase_file: RootPassphrase = None,
    own_passphrase_file: OwnPassphrase = None,
    as_json: AsJson = False,
) -> ExitCode:
    """Change the root key, in two versions of the trust root: one names both keys, the next one revokes the old.

    Vehicles go from the one to the other by themselves; whoever audits by the root key's pin is given the new one
    (`rtshcua keys show`). A root that has expired is renewed so.
    """

    def rotated(store: KeyStore, root: TrustRoot, signer: SigningKey, now_us: int) -> ExitCode | None:
        own = _own_passphrase(root, own_passphrase_file)
        if own is False:
            return fail(ExitCode.USAGE, _NO_PASSPHRASE)
        expires_us = None if days is None else now_us + days * _DAY_US
        seed = secrets.token_bytes(SEED_BYTES)
        store.rotate(seed, passphrase=own or None, signer=signer, now_us=now_us, expires_us=expires_us)
        return None

    return _succeeded(rotated, passphrase_file, as_json=as_json)


@app.command()
def accept(
    roots: Annotated[list[Path], typer.Argument(metavar="ROOT", help="signed trust roots, from the oldest on")],
    vehicle: Annotated[str, typer.Option(metavar="IDENTITY", help="who this vehicle is")],
    state_dir: Annotated[Path | None, typer.Option(help="where the vehicle's state is kept (the data folder)")] = None,
    as_json: AsJson = False,
) -> ExitCode:
    """On the vehicle: take a newer trust root, which may revoke keys. No older one is taken again.

    Each root follows from the one before, without a gap: a vehicle that missed some is given those between too, which
    may have expired. The first that a vehicle ever takes is trusted for being named here.
    """
    state = state_dir or state_folder()
    now_us = time.time_ns() // 1000
    try:
        taken = trust(roots, data_folder(), state, vehicle, now_us)
    except Untrusted as error:
        return fail(code_of(error.slug), str(error), HELPS.get(error.slug), slug=f"root-{error.slug}")
    if taken.distrust is not None:
        slug = f"root-{taken.distrust.slug.removeprefix('root-')}"
        return refuse(taken.distrust._replace(slug=slug))
    RootStore(state, vehicle).keep(taken.signed)
    root = taken.root
    if as_json:
        revoked = sorted(name.hex() for name in root.revocations)
        said = {"vehicle": vehicle, "version": root.version, "expires_at_us": root.expires_at_us, "revoked": revoked}
        out_json(json.dumps(said, ensure_ascii=False))
    else:
        out(
            taken.news
            or f"trust root version {root.version} is in force on `{vehicle}`, until {utc(root.expires_at_us)}"
        )
    return ExitCode.OK


@app.command(name="list")
def list_(
    as_json: AsJson = False,
) -> ExitCode:
    """List the keys of the key store, and what the trust root trusts them for."""
    return _listed(KeyStore(data_folder()), as_json=as_json)


@app.command()
def show(
    as_json: AsJson = False,
) -> ExitCode:
    """Print the pin of the trust root: what an auditor gives to `rtshcua verify-log --root`."""
    store = KeyStore(data_folder())
    try:
        root = _root(store)
        kid = store.pin()
    except Untrusted as error:
        return _refused(error)
    public = next(key.public for key in root.keys if key.kid == kid)
    if as_json:
        out_json(json.dumps({"root_key": public.hex(), "kid": kid.hex(), "development": root.development}))
    else:
        out(public.hex())
    return ExitCode.OK


@app.command()
def link(
    file: Annotated[Path, typer.Argument(help="the file to make; with --connect it may be there")],
    passphrase_file: Annotated[
        Path | None,
        typer.Option(help="make the key of this passphrase, as ground stations do, instead of a random one"),
    ] = None,
    connect: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="put the key on the vehicle there, and look what comes of it"),
    ] = None,
    trusted_link: Annotated[
        bool,
        typer.Option("--trusted-link", help="you vouch that nobody else hears this link: the key crosses it in clear"),
    ] = False,
    system: System = None,
) -> ExitCode:
    """Make a key for MAVLink 2 signing: `rtshcua run --signing-key FILE`, and the same key in the vehicle.

    With `--connect` the vehicle gets it too (SETUP_SIGNING), over a link that you vouch for, disarmed, on the ground.
    It is then seen whether signed frames are answered, and unsigned ones are not; code 0 means that. A vehicle that
    has the key gets nothing, and is looked at only. One key a vehicle.
    """
    if connect is None and (trusted_link or system is not None):
        return fail(ExitCode.USAGE, "`--trusted-link` and `--system` are about the link of `--connect`")
    if connect is not None:
        if not trusted_link:
            help = "a cable, or a network of its own; `--trusted-link` says that you vouch for it"
            return fail(ExitCode.USAGE, "the key would cross the link in clear: nobody vouches for it", help)
        try:
            address = parse_address(connect)
        except AddressError as error:
            return misaddressed("--connect", error)
    if connect is None or passphrase_file is not None or not file.exists():
        code = _make_link_key(file, passphrase_file)
        if code is not ExitCode.OK or connect is None:
            return code
    return _set_up(file, address, system)


def _make_link_key(file: Path, passphrase_file: Path | None) -> ExitCode:
    key = secrets.token_bytes(KEY_OCTETS)
    if passphrase_file is not None:
        try:
            passphrase = read_passphrase(passphrase_file)
        except Untrusted as error:
            return _refused(error)
        if len(passphrase.decode(errors="replace")) < _SHORTEST:
            return fail(ExitCode.USAGE, f"a link key needs a passphrase of {_SHORTEST} characters or more")
        key = hashlib.sha256(passphrase).digest()
    try:
        write_link_key(file, key)
    except FileExistsError:
        return fail(ExitCode.REFUSED, f"there is a file `{file}` already", "a key that is in use is not overwritten")
    out(f"{file}: link key {fingerprint(key)}")
    return ExitCode.OK


def _set_up(file: Path, address: Address, system: int | None) -> ExitCode:
    """Put a link key on the vehicle at an address, and say what was seen."""
    try:
        key = read_link_key(file)
    except LinkKeyError as error:
        return fail(code_of(error.slug), str(error), error.help, slug=f"link-key-{error.slug}")
    try:
        transport = open_transport(address)
    except OSError as error:
        return refuse(unopened(address, error), ExitCode.LINK)
    clock = SystemClock()
    begun = clock.now()
    try:
        setup = LinkSetup(key, begun.utc_us, begun.monotonic_us, system, begins=transport.begins)
        seen = carry_out(setup, transport, lambda: clock.now().monotonic_us)
    finally:
        transport.close()
    if isinstance(seen, Refusal):
        return refuse(seen, ExitCode.LINK if seen.slug in ("no-vehicle", "no-answer") else ExitCode.REFUSED)
    release = "of an unknown release" if seen.release is None else ".".join(map(str, seen.release))
    did = "it has this key, nothing was sent" if seen.already else "disarmed, on the ground: the key was sent"
    yes = {True: "yes", False: "no"}
    out(
        f"{seen.autopilot} {release}, system {seen.system}: {did}",
        f"  signs what it sends           {yes[seen.signs]}",
        f"  answers a signed request      {yes[seen.answers_signed]}",
        f"  answers an unsigned request   {yes[seen.answers_unsigned]}",
        *(f"  it said                       `{text}`" for text in seen.texts),
        f"  {after_setup(seen.autopilot, seen.release)}",
    )
    if seen.insists:
        return ExitCode.OK
    if seen.signs and seen.answers_signed:
        help = "over USB that may be so: the same command on the link that it flies with looks there, and sends nothing"
        return fail(ExitCode.REFUSED, "it has the key, and obeys on this link without it", help, slug="not-insisted")
    return fail(
        ExitCode.REFUSED,
        "the key has no effect on this link",
        "it was refused, or is not known there",
        slug="no-effect",
    )


def _added(
    duty: Duty,
    named: Callable[[SigningKey], VerificationKey],
    passphrase_file: Path | None,
    own_passphrase_file: Path | None,
    *,
    as_json: bool,
) -> ExitCode:
    """Make a key more, and say what the root trusts now."""
    store = KeyStore(data_folder())
    try:
        own = None
        if not _root(store).development:
            own = _new_passphrase(own_passphrase_file)
            if own is None:
                return fail(ExitCode.USAGE, _NO_PASSPHRASE)
        signer = unlock(store, Duty.ROOT, passphrase_file=passphrase_file)
        store.add(
            secrets.token_bytes(SEED_BYTES),
            named,
            duty=duty,
            passphrase=own,
            signer=signer,
            now_us=time.time_ns() // 1000,
        )
    except Untrusted as error:
        return _refused(error)
    return _handed(store, as_json=as_json)


def _succeeded(
    change: Callable[[KeyStore, TrustRoot, SigningKey, int], ExitCode | None],
    passphrase_file: Path | None,
    *,
    as_json: bool,
) -> ExitCode:
    """Make a root that follows from the store's, say what it trusts, and who is to be given it."""
    store = KeyStore(data_folder())
    try:
        root = _root(store)
        signer = unlock(store, Duty.ROOT, passphrase_file=passphrase_file)
        code = change(store, root, signer, time.time_ns() // 1000)
        if code is not None:
            return code
    except Untrusted as error:
        return _refused(error)
    return _handed(store, as_json=as_json)


def _handed(store: KeyStore, *, as_json: bool) -> ExitCode:
    """Say what the root trusts now, and how vehicles get it: with those before, which some may have missed."""
    code = _listed(store, as_json=as_json)
    if code is ExitCode.OK and not as_json:
        before = range(_root(store).version - len(store.chain()) + 1, _root(store).version)
        files = [*map(store.earlier_path, before), store.root_path]
        words = ("rtshcua", "keys", "accept", *map(str, files), "--vehicle", "IDENTITY")
        out("", "hand it to each vehicle:")
        for line in typed(words, columns() - 2):
            out_rendered(f"  {visible(line)}")
    return code


def _named(store: KeyStore, root: TrustRoot, text: str) -> VerificationKey | ExitCode:
    """The key that a person means; an exit code where that is none, or several."""
    paths = store.paths(root)
    digits = text.lower() if _KEY_ID.fullmatch(text.lower()) else None
    found = [
        key
        for key in root.keys
        if text in (paths[key.kid].name, paths[key.kid].stem)
        or (digits is not None and key.kid.hex().startswith(digits))
    ]
    if len(found) == 1:
        return found[0]
    if digits is not None and any(name.hex().startswith(digits) for name in root.revocations):
        return _revoked_already(text)
    what = "means several keys" if found else "is no key that the trust root names"
    return fail(ExitCode.USAGE, f"`{text}` {what}", "`rtshcua keys list` shows them: an id, or the name of its file")


def _revoked_already(text: str) -> ExitCode:
    return fail(ExitCode.USAGE, f"`{text}` was revoked already", "`rtshcua keys list` shows what is")


def _link_named(text: str) -> bytes | None:
    """The name of a link's key: 16 hexadecimal digits, or that of the key in a file. Raises OSError."""
    if _LINK_ID.fullmatch(text.lower()):
        return bytes.fromhex(text)
    try:
        return bytes.fromhex(fingerprint(read_link_key(Path(text))))
    except LinkKeyError:
        return None


def _own_passphrase(root: TrustRoot, file: Path | None) -> bytes | Literal[False]:
    """What a new key of this root is encrypted with; empty for development, False where no good one was given."""
    return b"" if root.development else _new_passphrase(file) or False


def _misnamed(roles: Sequence[str], policies: Sequence[str]) -> ExitCode | None:
    """Fails for the first that can be no role or policy of any source; None where each can."""
    for what, names in (("role", roles), ("policy", policies)):
        for name in names:
            if name != ANY and not _ROLE.fullmatch(name):
                return _no_name(name, what)
    return None


def _no_name(name: str, what: str) -> ExitCode:
    return fail(ExitCode.USAGE, f"`{visible(name)}` is no {what}", "accepted: a name, as policies write it")


def _no_person(name: str) -> ExitCode:
    text = f"`{visible(name)}` is no name of a person"
    return fail(ExitCode.USAGE, text, "accepted: up to 64 lower-case letters, digits, `.`, `_` and `-`")


def _listed(store: KeyStore, *, as_json: bool) -> ExitCode:
    try:
        root = _root(store)
    except Untrusted as error:
        return _refused(error)
    if as_json:
        out_json(json.dumps(_as_object(store, root), indent=2, ensure_ascii=False))
        return ExitCode.OK
    kind = "development root: for trying out, its keys are not encrypted" if root.development else "trust root"
    out(kind, f"  folder   {store.folder}", f"  version  {root.version}")
    out(f"  valid    {utc(root.issued_at_us)} to {utc(root.expires_at_us)}", "")
    names = {kid: path.name for kid, path in store.paths(root).items()}
    wide = max(map(len, names.values()))
    rows = [("duty", "key", "file", "may speak for")]
    rows += ((key.duty, key.kid.hex(), names[key.kid], speaks(key)) for key in root.keys)
    for name in sorted(root.revocations):
        what = "the key of a link" if len(name) == LINK_ID_BYTES else "never trusted again"
        rows.append(("revoked", name.hex(), "", what))
    beside = 2 + 10 + 34 + wide + 2 + max(len(row[3]) for row in rows) <= columns()
    for duty, key_name, file, last in rows:
        first = f"  {duty:<9} {key_name:<33} {file:<{wide}}"
        out(*([f"{first}  {last}"] if beside else [first.rstrip(), f"  {'':<9} {last}"]))
    if root.witness_threshold > 1:
        out("", f"  {root.witness_threshold} witnesses must cosign what counts as anchored")
    return ExitCode.OK


def _as_object(store: KeyStore, root: TrustRoot) -> dict[str, object]:
    paths = store.paths(root)
    return {
        "folder": str(store.folder),
        "root": str(store.root_path),
        "development": root.development,
        "version": root.version,
        "issued_at_us": root.issued_at_us,
        "expires_at_us": root.expires_at_us,
        "witness_threshold": root.witness_threshold,
        "revoked": sorted(name.hex() for name in root.revocations),
        "keys": [{**as_object(key), "file": str(paths[key.kid])} for key in root.keys],
    }


def _root(store: KeyStore) -> TrustRoot:
    """The store's own root, also an expired one: it is here to be looked at."""
    return open_root(store.root(), pinned=store.pin(), now_us=0)


def _refused(error: Untrusted) -> ExitCode:
    return refuse(untrusted(error), ExitCode.INPUT if error.slug == "no-keys" else None)


def _new_passphrase(path: Path | None) -> bytes | None:
    if path is not None:
        given = read_passphrase(path)
    elif sys.stdin is not None and sys.stdin.isatty():
        given = getpass("new passphrase: ").encode()
        if getpass("once more: ").encode() != given:
            return None
    else:
        return None
    return given if len(given.decode(errors="replace")) >= _SHORTEST else None
