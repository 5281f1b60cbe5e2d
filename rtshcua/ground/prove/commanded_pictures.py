"""Whether the commands of a skill take the pictures that it states (E1708, E1704; E1314 of `ground/lint`).

What `pictures by C every 8 m` proves holds only if somebody takes a picture that often. So a skill that commands the
camera itself must do it at least that often, and no faster than the camera can. Distances and times are compared at
the greatest speed of the skill, as the proofs of its pictures do.
"""

from collections.abc import Iterator
from fractions import Fraction
from math import floor
from typing import Final, NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.geometry.cameras import passed_in, time_for
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.model.ir.expression import Quantity, Reference
from rtshcua.model.ir.places import CameraDecl
from rtshcua.model.ir.skills import EmitsDecl, PicturesDecl, SkillDecl
from rtshcua.model.quantity import Dimension, display

SERIES: Final = "MAV_CMD_IMAGE_START_CAPTURE"
BY_DISTANCE: Final = "MAV_CMD_DO_SET_CAM_TRIGG_DIST"
BY_ITSELF: Final = "MAV_CMD_DO_TRIGGER_CONTROL"
#: the commands after which a camera takes pictures
TAKING: Final = frozenset({SERIES, BY_DISTANCE, BY_ITSELF, "MAV_CMD_DO_DIGICAM_CONTROL"})
_SECOND_US: Final = 1_000_000
#: mm, us: steps of an accepted value
_STEPS: Final = {Dimension.LENGTH: 100, Dimension.DURATION: 1_000}


class Spacing(NamedTuple):
    """The distance in mm or the time in us between two pictures that a command takes, and where that is written."""

    value: int
    dimension: Dimension
    span: Span

    def distance(self, speed: int) -> Fraction:
        """The greatest distance in mm between two of them."""
        return Fraction(self.value) if self.dimension is Dimension.LENGTH else passed_in(speed, self.value)

    def time(self, speed: int) -> int:
        """The shortest time in us between two of them."""
        return self.value if self.dimension is Dimension.DURATION else time_for(self.value, speed)


def takes_pictures(skill: SkillDecl) -> bool:
    """Whether a skill commands a camera to take pictures."""
    return any(emits.command.text in TAKING for emits in skill.emits)


def prove_commanded(proof: ProofContext, skill: SkillDecl, pictures: PicturesDecl, camera: CameraDecl) -> None:
    """Report commands that take pictures more rarely than the skill states, or faster than the camera can."""
    every, taking = pictures.every, [each for each in skill.emits if each.command.text in TAKING]
    by_itself = BY_ITSELF in {each.command.text for each in taking}
    if every is None or not taking or by_itself:
        return
    speed = _greatest_speed(proof, skill)
    stated = Spacing(every.value, every.dimension, every.span)
    spaced = [found for each in taking for found in _spacing(proof, skill, each)]
    if not spaced:
        _only_at_points(proof, taking[0], stated)
        return
    for each in spaced:
        if each.time(speed) < camera.interval.value:
            _too_fast(proof, each, speed, camera)
    closest = min(spaced, key=lambda each: each.distance(speed))
    if closest.distance(speed) > stated.distance(speed):
        _too_rare(proof, closest, stated, speed)


def _greatest_speed(proof: ProofContext, skill: SkillDecl) -> int:
    assert skill.motion is not None
    named = skill.motion.speed
    return (named and proof.context.arguments(skill)[named.text].high) or proof.policy.vehicle.speed


def _spacing(proof: ProofContext, skill: SkillDecl, emits: EmitsDecl) -> Iterator[Spacing]:
    """Yield the greatest spacing of the pictures of a command; nothing if it takes them at points alone."""
    if emits.command.text == BY_DISTANCE:
        yield from _number(proof, skill, emits, "param1", Dimension.LENGTH)
    elif isinstance(emits.every, Quantity):
        yield Spacing(emits.every.value, emits.every.dimension, emits.every.span)
    elif emits.command.text == SERIES and _constant(emits, "param3") == 0:
        yield from _number(proof, skill, emits, "param2", Dimension.DURATION)


def _number(
    proof: ProofContext, skill: SkillDecl, emits: EmitsDecl, field: str, dimension: Dimension
) -> Iterator[Spacing]:
    """Yield a parameter of a command as a spacing, of an argument the greatest one; 0 takes no pictures."""
    found = next((each.value for each in emits.parameters if each.fields[0].text == field), None)
    value: int | None = None
    if isinstance(found, Quantity):
        value = found.value
    elif isinstance(found, Reference) and found.name in proof.context.arguments(skill):
        value = proof.context.arguments(skill)[found.name].high
    if found is not None and value:
        yield Spacing(value, dimension, found.span)


def _constant(emits: EmitsDecl, field: str) -> int | None:
    found = next((each.value for each in emits.parameters if each.fields[0].text == field), None)
    return found.value if isinstance(found, Quantity) else None


def _only_at_points(proof: ProofContext, emits: EmitsDecl, stated: Spacing) -> None:
    told = display(stated.value, stated.dimension)
    proof.report.add(
        codes.RARE_PICTURES,
        emits.span,
        f"pictures are taken at single moments, and not every {told}",
        help=f"write `every {told}` for the moment, or leave `every` out of `pictures`",
        labels=[(stated.span, "stated here")],
    )


def _too_rare(proof: ProofContext, found: Spacing, stated: Spacing, speed: int) -> None:
    of_length = found.dimension is Dimension.LENGTH
    nearest = floor(stated.distance(speed)) if of_length else stated.time(speed)
    step = _STEPS[found.dimension]
    accepted = display(nearest if nearest < step else nearest // step * step, found.dimension)
    taken, told = (display(each.value, each.dimension) for each in (found, stated))
    at = "" if found.dimension is stated.dimension else f" at {display(speed, Dimension.SPEED)}"
    proof.report.add(
        codes.RARE_PICTURES,
        found.span,
        f"pictures are taken every {taken}, which{at} is more rarely than every {told}",
        help=f"nearest accepted: `{accepted}`",
        labels=[(stated.span, "stated here")],
        fix=_replaced(proof, found, accepted),
    )


def _too_fast(proof: ProofContext, found: Spacing, speed: int, camera: CameraDecl) -> None:
    interval, step = camera.interval.value, _STEPS[found.dimension]
    least = interval if found.dimension is Dimension.DURATION else -(-interval * speed // _SECOND_US)
    accepted = display(-(-least // step) * step, found.dimension)
    due = display(found.time(speed) // 1_000 * 1_000, Dimension.DURATION)
    needs = display(interval, Dimension.DURATION)
    proof.report.add(
        codes.HASTY_PICTURES,
        found.span,
        f"at {display(speed, Dimension.SPEED)} pictures are taken every {due}, but the camera needs {needs}",
        help=f"nearest accepted: `{accepted}`",
        labels=[(camera.span, "the camera")],
        fix=_replaced(proof, found, accepted),
    )


def _replaced(proof: ProofContext, found: Spacing, accepted: str) -> tuple[Span, str, str] | None:
    """The correction of a spacing that is written as a number."""
    written = proof.report.text(found.span)
    return (found.span, accepted, f"write `{accepted}`") if written[:1].isdigit() else None
