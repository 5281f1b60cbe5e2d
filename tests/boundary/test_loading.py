"""A boundary in C may load a bundle in place of another one while nothing flies."""

import ctypes

from msgspec.structs import replace

from boundary.both_boundaries import begin
from reference.flat_case import MISSION
from reference.world import FLIGHT, ROOT, ROOT_KEY, SESSION_KEY, START, VEHICLE, allowed, sealed
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.onboard.enforcement.executor import FORGED
from rtshcua.onboard.enforcement.isolated import Caller
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load
from rtshcua.onboard.ports import Command


def held(boundary: ctypes.CDLL) -> Caller:
    pin = ROOT_KEY.verification().public
    return begin(boundary, ROOT.sign(ROOT_KEY), pin, VEHICLE, SESSION_KEY, START)


def into(caller: Caller, bundle: bytes) -> Loaded:
    made = load(
        bundle, root=ROOT, vehicle=VEHICLE, now=START, mode=EnforcementMode.PROCESS, session_key=SESSION_KEY,
        flight=FLIGHT,
        peer_is_own_simulator=False, caller=caller,
    )  # fmt: skip
    assert isinstance(made, Loaded), made
    return made


def test_a_permit_of_the_bundle_before_sends_nothing(boundary: ctypes.CDLL) -> None:
    """Its number now means another step, which was not requested."""
    caller = held(boundary)
    permit = allowed(into(caller, sealed()))
    other = into(caller, sealed(mission=replace(MISSION, name="other")))
    assert other.executor.dispatch(permit, START.monotonic_us) is FORGED
    assert isinstance(other.executor.dispatch(allowed(other), START.monotonic_us), Command)


def test_unsent_bundle_can_be_loaded_again(boundary: ctypes.CDLL) -> None:
    caller = held(boundary)
    into(caller, sealed())
    into(caller, sealed(mission=replace(MISSION, name="other")))
    allowed(into(caller, sealed()))


def test_no_bundle_is_taken_while_one_flies(boundary: ctypes.CDLL) -> None:
    caller = held(boundary)
    made = into(caller, sealed())
    assert isinstance(made.executor.dispatch(allowed(made), START.monotonic_us), Command)
    refused = caller.load(sealed(), START)
    assert isinstance(refused, Refusal)
    assert refused.slug == "flies"
