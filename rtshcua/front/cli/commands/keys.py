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

# the options that its commands share
Vehicles = Annotated[list[str] | None, typer.Option(help="the identity of a vehicle [default: any] (repeatable)")]
RootPassphrase = Annotated[Path | None, typer.Option(help="a file with the root key's passphrase")]
OwnPassphrase = Annotated[Path | None, typer.Option(help="a file with the passphrase to encrypt the new key with")]

_MOST_WITNESSES = 16


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
        f"  boundary key   {made.boundary_key or 'none: the trust root names none for it'}",
        f"  link key       {made.link_key or 'none'}",
        "give it to the boundary's user: `chown -R rtshcua-boundary:` it, and keep these keys nowhere else aboard",
    )
    return ExitCode.OK


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
    named = service.mission_key(source, role, policy, vehicle or (ANY,))
    if isinstance(named, Refusal):
        return refuse(named)
    _warn_of_unknown(each for each in role if each != ANY)
    return _added(Duty.MISSION, named, passphrase_file, own_passphrase_file, as_json=as_json)


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
    store = service.key_store()
    refused = service.revoke(store, key or (), link or (), _secrets(store, passphrase_file, None))
    return _handed(store, refused, as_json=as_json)


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
    store = service.key_store()
    refused = service.replace_key(store, key, _secrets(store, passphrase_file, own_passphrase_file))
    return _handed(store, refused, as_json=as_json)


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
    store = service.key_store()
    refused = service.rotate_root(store, days, _secrets(store, passphrase_file, own_passphrase_file))
    return _handed(store, refused, as_json=as_json)


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
    """List the keys of the key store, and what the trust root trusts them for."""
    return _listed(service.key_store(), as_json=as_json)


@app.command()
def show(
    as_json: AsJson = False,
) -> ExitCode:
    """Print the pin of the trust root: what an auditor gives to `rtshcua verify-log --root`."""
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
    if connect is not None and not trusted_link:
        help = "a cable, or a network of its own; `--trusted-link` says that you vouch for it"
        return fail(ExitCode.USAGE, "the key would cross the link in clear: nobody vouches for it", help)
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
    """Put a link key on the vehicle at an address, and say what was seen."""
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
    """Make a key more, and say what the root trusts now."""
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
    """Say what the root trusts now, and how vehicles get it: with those before, which some may have missed."""
    if refused is not None:
        return refuse(refused)
    code = _listed(store, as_json=as_json)
    if code is ExitCode.OK and not as_json:
        words = ("rtshcua", "keys", "accept", *map(str, service.root_files(store)), "--vehicle", "IDENTITY")
        out("", "hand it to each vehicle:")
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
        if getpass("once more: ").encode() != given:
            return None
    else:
        return None
    return given if len(given.decode(errors="replace")) >= service.SHORTEST else None
