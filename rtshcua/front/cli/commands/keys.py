"""`rtshcua keys`: make, list, replace and revoke signing keys, and the trust root."""

import json
import sys
from collections.abc import Callable, Iterable
from getpass import getpass
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.adapters.store.keystore import OPERATOR, OWNER, KeyStore
from rtshcua.adapters.vehicle.address import Address
from rtshcua.app import key_management as service
from rtshcua.app.key_management import NewStore, ProvisionRequest, Secrets
from rtshcua.app.wording import utc
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import fail, refuse, say
from rtshcua.front.cli.options.addresses import address_of
from rtshcua.front.cli.options.document_options import AsJson
from rtshcua.front.cli.options.flight_options import System
from rtshcua.front.cli.render.showing.keys import link_lines, show_store
from rtshcua.front.cli.stdout import out, out_json, out_rendered
from rtshcua.front.cli.unlock import read_passphrase, unlock
from rtshcua.front.cli.width import columns, typed
from rtshcua.wire.keys import ANY, Duty, SigningKey, VerificationKey
from rtshcua.wire.untrusted import Untrusted

app = typer.Typer(add_completion=False)

Vehicles = Annotated[list[str] | None, typer.Option(help="identity of a vehicle [default: any] (repeatable)")]
RootPassphrase = Annotated[Path | None, typer.Option(help="file with the passphrase of the root key")]
OwnPassphrase = Annotated[Path | None, typer.Option(help="file with the passphrase for the new key")]

_MOST_WITNESSES = 16


@app.callback()
def keys() -> None:
    """Create, list, replace and revoke signing keys, and manage the trust root."""


@app.command()
def init(
    if_missing: Annotated[bool, typer.Option("--if-missing", help="do nothing if keys exist")] = False,
    development: Annotated[
        bool, typer.Option("--development/--encrypted", help="unencrypted keys for development, or encrypted keys")
    ] = True,
    days: Annotated[int, typer.Option(min=1, max=3660, help="validity of the trust root")] = 365,
    passphrase_file: Annotated[Path | None, typer.Option(help="file with the passphrase for the keys")] = None,
    witnesses: Annotated[int, typer.Option(min=0, max=_MOST_WITNESSES, help="number of witness keys")] = 1,
    witness_threshold: Annotated[
        int,
        typer.Option(
            min=1, max=_MOST_WITNESSES, help="number of witnesses that must cosign a record for it to be anchored"
        ),
    ] = 1,
    role: Annotated[
        list[str] | None, typer.Option(help="role allowed in missions [default: operator] (repeatable)")
    ] = None,
    policy: Annotated[
        list[str] | None,
        typer.Option(help="policy allowed for missions; required for encrypted keys [default: any] (repeatable)"),
    ] = None,
    owner: Annotated[
        str, typer.Option("--approver", help="name of the person who may recall flights and answer as operator")
    ] = OWNER,
    as_json: AsJson = False,
) -> ExitCode:
    """Create a key for each duty, and the trust root that names them.

    There are two mission keys: one signs only missions proposed by agents, the other missions proposed by people. The
    approval key belongs to one person; `rtshcua keys approver` creates keys for others. A development root is marked as
    such; its keys are unencrypted in your data folder and readable only by you. A witness is useful only away from the
    vehicle: move its key to where `rtshcua witness` runs, and the log key to the vehicle.
    """
    store = service.key_store()
    if not (if_missing and store.exists()):
        new = NewStore(
            development, days, witnesses, witness_threshold, role or (OPERATOR,), policy or (), owner
        )  # fmt: skip
        refused = service.create(store, new, _secrets(store, None, passphrase_file))
        if refused is not None:
            return refuse(refused)
    return _listed(store, as_json=as_json)


@app.command()
def approver(
    name: Annotated[str, typer.Argument(help="name of the person: lower-case letters, digits, `.`, `_`, `-`")],
    role: Annotated[str, typer.Option(help="role in which this person approves")],
    vehicle: Vehicles = None,
    passphrase_file: RootPassphrase = None,
    own_passphrase_file: OwnPassphrase = None,
    as_json: AsJson = False,
) -> ExitCode:
    """Create an approval key for one person in one role, and the next version of the trust root, which names it.

    The name identifies the person: if a rule requires two people, two keys of one name count as one person. Give the
    key file to the person and keep no copy. Clients that pinned the root key also trust the new root.
    """
    named = service.approver_key(name, role, vehicle or (ANY,))
    if isinstance(named, Refusal):
        return refuse(named)
    _warn_of_unknown([role])
    return _added(Duty.APPROVAL, named, passphrase_file, own_passphrase_file, as_json=as_json)


@app.command()
def boundary(
    vehicle: Vehicles = None,
    passphrase_file: RootPassphrase = None,
    own_passphrase_file: OwnPassphrase = None,
    as_json: AsJson = False,
) -> ExitCode:
    """Create a key for the enforcement boundary, and the next version of the trust root, which names it.

    `init` creates one; use this command for a trust root without one. From then on, the boundary signs its decisions in
    each flight, and a log without that signature does not verify.
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
    folder: Annotated[Path, typer.Argument(help="parent of the new folder: `/var/lib/rtshcua-boundary`")],
    vehicle: Annotated[str, typer.Option(metavar="IDENTITY", help="identity of the vehicle, and name of its folder")],
    signing_key: Annotated[Path | None, typer.Option(metavar="FILE", help="key of its link, if it has one")] = None,
    log_key: Annotated[Path | None, typer.Option(help="key that signs the log (default: the key store's)")] = None,
    boundary_key: Annotated[
        Path | None, typer.Option(help="key of the enforcement boundary (default: the key store's)")
    ] = None,
    passphrase_file: Annotated[Path | None, typer.Option(help="file with the passphrase of these keys")] = None,
    again: Annotated[
        bool, typer.Option("--again", help="replace an earlier provisioned folder, which must not be used again")
    ] = False,
    as_json: AsJson = False,
) -> ExitCode:  # fmt: skip
    """Create the folder of a listening boundary (`run --boundary-socket`): its decrypted keys and the trust root.

    The folder is created atomically, readable only by its owner; an existing one is not changed. Give it to the user of
    the boundary, and keep these keys nowhere else on the vehicle. A new folder does not know which bundles an earlier
    one opened. It therefore refuses bundles issued before its creation, and a second folder for the same vehicle
    requires `--again` and a new boundary key.
    """
    request = ProvisionRequest(folder, vehicle, signing_key, log_key, boundary_key, again)
    store = service.key_store()
    made = service.provision(store, request, _secrets(store, passphrase_file, None))
    if isinstance(made, Refusal):
        return refuse(made)
    names = {"log_key": made.log_key, "boundary_key": made.boundary_key, "link_key": made.link_key}
    if as_json:
        out_json(json.dumps({"vehicle": vehicle, "folder": str(made.place), "trust_root": made.trust_root, **names}))
        return ExitCode.OK
    out(
        f"{made.place}: the boundary of `{vehicle}`, under trust root version {made.trust_root}",
        f"  log key        {made.log_key}",
        f"  boundary key   {made.boundary_key or 'none: the trust root has none for it'}",
        f"  link key       {made.link_key or 'none'}",
        "give it to the boundary's user (`chown -R rtshcua-boundary:`); keep these keys nowhere else on the vehicle",
    )
    return ExitCode.OK


@app.command()
def mission(
    source: Annotated[str, typer.Argument(metavar="agent|operator", help="who proposes the missions it signs")],
    role: Annotated[list[str], typer.Option(help="role of the missions (repeatable)")],
    policy: Annotated[list[str], typer.Option(help="policy of the missions (repeatable)")],
    vehicle: Vehicles = None,
    passphrase_file: RootPassphrase = None,
    own_passphrase_file: OwnPassphrase = None,
    as_json: AsJson = False,
) -> ExitCode:
    """Create a mission key for one source, bound to roles and policies, and the next version of the trust root.

    `rtshcua compile` signs with the first permitted key of the key store, or with `--mission-key FILE`.
    """
    named = service.mission_key(source, role, policy, vehicle or (ANY,))
    if isinstance(named, Refusal):
        return refuse(named)
    _warn_of_unknown(each for each in role if each != ANY)
    return _added(Duty.MISSION, named, passphrase_file, own_passphrase_file, as_json=as_json)


@app.command()
def revoke(
    key: Annotated[
        list[str] | None, typer.Argument(metavar="KEY", help="the key's id, its first 8 digits, or its file name")
    ] = None,
    link: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ID", help="key of a link: the id printed by `rtshcua keys link`, or its file (repeatable)"
        ),
    ] = None,
    passphrase_file: RootPassphrase = None,
    as_json: AsJson = False,
) -> ExitCode:
    """Create the next version of the trust root, which revokes keys permanently.

    A vehicle refuses their signatures as soon as it accepts that root, by `rtshcua keys accept` or by its next flight.
    """
    store = service.key_store()
    refused = service.revoke(store, key or (), link or (), _secrets(store, passphrase_file, None))
    return _handed(store, refused, as_json=as_json)


@app.command(name="replace")
def replace_(
    key: Annotated[str, typer.Argument(help="the key's id, its first 8 digits, or its file name")],
    passphrase_file: RootPassphrase = None,
    own_passphrase_file: OwnPassphrase = None,
    as_json: AsJson = False,
) -> ExitCode:
    """Revoke a key and create a new one with the same duty, roles and limits.

    The old file is moved aside. Give the new file to the holder of the old one, and the trust root to the vehicles.
    """
    store = service.key_store()
    refused = service.replace_key(store, key, _secrets(store, passphrase_file, own_passphrase_file))
    return _handed(store, refused, as_json=as_json)


@app.command()
def rotate_root(
    days: Annotated[
        int | None, typer.Option(min=1, max=3660, help="validity of the new root [default: as the old root]")
    ] = None,
    passphrase_file: RootPassphrase = None,
    own_passphrase_file: OwnPassphrase = None,
    as_json: AsJson = False,
) -> ExitCode:
    """Change the root key in two versions of the trust root: one names both keys, the next one revokes the old key.

    Vehicles follow from one to the other. Auditors that pin the root key need the new pin (`rtshcua keys show`). This
    command also renews an expired root.
    """
    store = service.key_store()
    refused = service.rotate_root(store, days, _secrets(store, passphrase_file, own_passphrase_file))
    return _handed(store, refused, as_json=as_json)


@app.command()
def accept(
    roots: Annotated[list[Path], typer.Argument(metavar="ROOT", help="signed trust roots, oldest first")],
    vehicle: Annotated[str, typer.Option(metavar="IDENTITY", help="identity of this vehicle")],
    state_dir: Annotated[
        Path | None, typer.Option(help="folder of the vehicle's state (default: the data folder)")
    ] = None,
    as_json: AsJson = False,
) -> ExitCode:
    """On the vehicle: accept a newer trust root, which may revoke keys. Older roots are refused from then on.

    The versions must be consecutive: if the vehicle missed some, name them too; these may have expired. The first root
    of a vehicle is trusted because it is named here.
    """
    taken = service.accept(roots, vehicle, state_dir)
    if isinstance(taken, Refusal):
        return refuse(taken)
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
    """List the keys of the key store and what the trust root permits them to sign."""
    return _listed(service.key_store(), as_json=as_json)


@app.command()
def show(
    as_json: AsJson = False,
) -> ExitCode:
    """Print the pin of the trust root, for `rtshcua verify-log --root`."""
    found = service.root_key(service.key_store())
    if isinstance(found, Refusal):
        return refuse(found)
    root, key = found
    if as_json:
        out_json(json.dumps({"root_key": key.public.hex(), "kid": key.kid.hex(), "development": root.development}))
    else:
        out(key.public.hex())
    return ExitCode.OK


@app.command()
def link(
    file: Annotated[Path, typer.Argument(help="file to create; with --connect it may exist")],
    passphrase_file: Annotated[
        Path | None,
        typer.Option(help="derive the key from this passphrase, as ground stations do (default: a random key)"),
    ] = None,
    connect: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="install the key on the vehicle at this address, and test it"),
    ] = None,
    trusted_link: Annotated[
        bool,
        typer.Option("--trusted-link", help="confirm that nobody else can read this link: the key is sent in clear"),
    ] = False,
    system: System = None,
) -> ExitCode:
    """Create a key for MAVLink 2 signing, for `rtshcua run --signing-key FILE` and for the vehicle.

    With `--connect`, the command installs the key on the vehicle (SETUP_SIGNING), over a trusted link, disarmed and on
    the ground. It then tests that the vehicle answers signed frames and ignores unsigned ones (exit code 0). If the
    vehicle already has the key, nothing is sent except the test. Use one key for each vehicle.
    """
    if connect is None and (trusted_link or system is not None):
        return fail(ExitCode.USAGE, "`--trusted-link` and `--system` require `--connect`")
    if connect is not None and not trusted_link:
        help = "use a cable or a separate network, and confirm it with `--trusted-link`"
        return fail(ExitCode.USAGE, "the key is sent in clear: `--connect` requires `--trusted-link`", help)
    address = None if connect is None else address_of(connect)
    if isinstance(address, ExitCode):
        return address
    if address is None or passphrase_file is not None or not file.exists():
        code = _make_link_key(file, passphrase_file)
        if code is not ExitCode.OK or address is None:
            return code
    return _set_up(file, address, system)


def _make_link_key(file: Path, passphrase_file: Path | None) -> ExitCode:
    try:
        passphrase = None if passphrase_file is None else read_passphrase(passphrase_file)
    except Untrusted as error:
        return refuse(service.refused(error))
    made = service.make_link_key(file, passphrase)
    if isinstance(made, Refusal):
        return refuse(made)
    out(f"{file}: link key {made}")
    return ExitCode.OK


def _set_up(file: Path, address: Address, system: int | None) -> ExitCode:
    """Install a link key on the vehicle at an address, and print the result of the test."""
    seen = service.set_up_link(file, address, system)
    if isinstance(seen, Refusal):
        return refuse(seen)
    out(*link_lines(seen))
    refused = service.effect_of(seen)
    return ExitCode.OK if refused is None else refuse(refused)


def _added(
    duty: Duty,
    named: Callable[[SigningKey], VerificationKey],
    passphrase_file: Path | None,
    own_passphrase_file: Path | None,
    *,
    as_json: bool,
) -> ExitCode:
    """Add a key, and print the new trust root."""
    store = service.key_store()
    refused = service.add_key(store, duty, named, _secrets(store, passphrase_file, own_passphrase_file))
    return _handed(store, refused, as_json=as_json)


def _secrets(store: KeyStore, passphrase_file: Path | None, own_passphrase_file: Path | None) -> Secrets:
    return Secrets(
        lambda duty, path: unlock(store, duty, path=path, passphrase_file=passphrase_file),
        lambda: _new_passphrase(own_passphrase_file),
    )


def _warn_of_unknown(roles: Iterable[str]) -> None:
    for warning in service.unknown_roles(roles):
        say(warning)


def _handed(store: KeyStore, refused: Refusal | None, *, as_json: bool) -> ExitCode:
    """Print the trust root, and the command by which vehicles accept it and the versions before it."""
    if refused is not None:
        return refuse(refused)
    code = _listed(store, as_json=as_json)
    if code is ExitCode.OK and not as_json:
        words = ("rtshcua", "keys", "accept", *map(str, service.root_files(store)), "--vehicle", "IDENTITY")
        out("", "run this on each vehicle:")
        for line in typed(words, columns() - 2):
            out_rendered(f"  {visible(line)}")
    return code


def _listed(store: KeyStore, *, as_json: bool) -> ExitCode:
    root = service.trust_root(store)
    if isinstance(root, Refusal):
        return refuse(root)
    show_store(store, root, as_json=as_json)
    return ExitCode.OK


def _new_passphrase(path: Path | None) -> bytes | None:
    if path is not None:
        given = read_passphrase(path)
    elif sys.stdin is not None and sys.stdin.isatty():
        given = getpass("new passphrase: ").encode()
        if getpass("repeat it: ").encode() != given:
            return None
    else:
        return None
    return given if len(given.decode(errors="replace")) >= service.SHORTEST else None
