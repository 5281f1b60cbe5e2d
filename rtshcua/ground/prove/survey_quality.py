"""Prove what the pictures of a survey show: pixel, overlap, interval and blur (E1701 to E1705, E1708).

A contract is proved for the worst case of its parameters' ranges, so every step within them keeps what its skill
demands. What depends on the area is proved for each step with its own arguments: the distance of the lines on a path,
and the reach of a round around a structure. The distance to what is seen is the height above home, less and plus
the `relief`, or the distance from a structure. All numbers are exact, and rounded to the safe side; the path is the
planned one, without the vehicle's position error (docs/survey.md).
"""

from collections.abc import Iterator
from fractions import Fraction
from itertools import chain, pairwise
from typing import Final, Literal, NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.codes import Code
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.substitution import named_at
from rtshcua.ground.checker.symbols import suggestion
from rtshcua.ground.geometry.cameras import SurveyCamera, apart, overlap, passed_in, time_for
from rtshcua.ground.geometry.polygons import path_length
from rtshcua.ground.geometry.survey import AROUND, DEFAULT_PATTERN, SIDEWAYS, around_reach, line_spacing, structure_of
from rtshcua.ground.lower.mission import argument_span
from rtshcua.ground.lower.survey_plan import SurveyPlan, camera_named, relief_of, survey_camera, survey_plan
from rtshcua.ground.prove.commanded_pictures import prove_commanded
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.policy import RuleKind
from rtshcua.model.ir.expression import Quantity
from rtshcua.model.ir.missions import MissionDecl, Step
from rtshcua.model.ir.places import CameraDecl
from rtshcua.model.ir.skills import MotionDecl, ParameterDecl, PicturesDecl, SkillDecl
from rtshcua.model.quantity import Dimension, display, micrometres

_SECOND_US: Final = 1_000_000
_MILLISECOND: Final = 1_000
#: steps of an accepted value, where it is at least that large: a tenth of a metre or of a metre per second
_TENTH: Final = 100


class SurveyRange(NamedTuple):
    """How a camera is flown: the least and greatest distance in mm to what it sees, and the greatest speed in mm/s.

    `seen` is the parameter that sets the distance, and `relief` how much more it may be.
    """

    camera: SurveyCamera
    near: int
    far: int
    speed: int
    seen: str = ""
    relief: int = 0


class Accepted(NamedTuple):
    """The nearest value that keeps a demand."""

    value: int
    dimension: Dimension

    @property
    def text(self) -> str:
        """The value with its unit."""
        return display(self.value, self.dimension)


class PictureFault(NamedTuple):
    """A demand that is not kept: the field of `PicturesDecl` that states it, and what was found.

    `change` is what to change, and `accepted` the nearest value of it that keeps the demand, if there is one.
    """

    code: Code
    part: str
    found: str
    change: Literal["distance", "every", "speed"]
    accepted: Accepted | None


class StepPictures(NamedTuple):
    """The pictures of a step: lengths in mm, `pixel_um` in um, shares in 1/10000, `blur` in 1/10000 of a pixel.

    Each is the worst over the step: the largest pixel and blur, the smallest footprint, overlap and interval. None: not
    stated, or without neighbours.
    """

    step_number: int
    skill: str
    camera: str
    pattern: str
    pixel_um: int
    along: int
    across: int
    forward: int | None
    lines_apart: int | None
    side: int | None
    blur: int
    interval_us: int | None
    pictures: int | None


def faults(flown: SurveyRange, pictures: PicturesDecl) -> Iterator[PictureFault]:
    """Yield each demand that is not kept, in the order of the clause."""
    camera, near, far, speed = flown[:4]
    every = pictures.every
    if every is not None:
        yield from _interval(camera, speed, every.value, every.dimension)
    resolution = pictures.resolution_um
    if resolution is not None and far > camera.farthest(resolution):
        shows, most = micrometres(_pixel_um(camera, far)), micrometres(resolution)
        found = f"a pixel may show {shows}, more than {most}"
        farthest = _rounded(camera.farthest(resolution) - flown.relief, Dimension.LENGTH)
        yield PictureFault(codes.COARSE_PICTURES, "resolution", found, "distance", farthest)
    forward, kept = pictures.forward, _forward(camera, near, speed, pictures)
    if every is not None and forward is not None and kept is not None and kept < forward.value:
        room = apart(camera.shows_along(near), forward.value)
        widest = room if every.dimension is Dimension.LENGTH else room * _SECOND_US // speed
        least = display(near, Dimension.LENGTH)
        found = f"from {least} successive pictures may overlap {_percent(kept)}, less than {_percent(forward.value)}"
        yield PictureFault(codes.SMALL_OVERLAP, "forward", found, "every", _rounded(widest, every.dimension))
    blur = camera.blur(speed, near)
    if pictures.blur is not None and blur > pictures.blur.value:
        seen = f"at {display(speed, Dimension.SPEED)} from {display(near, Dimension.LENGTH)}"
        found = f"{seen} a picture may smear by {_percent(blur)} of a pixel, more than {_percent(pictures.blur.value)}"
        fastest = _rounded(camera.fastest(pictures.blur.value, near), Dimension.SPEED)
        yield PictureFault(codes.BLURRED_PICTURES, "blur", found, "speed", fastest)


def _interval(camera: SurveyCamera, speed: int, every: int, dimension: Dimension) -> Iterator[PictureFault]:
    least = display(camera.interval_us, Dimension.DURATION)
    if dimension is Dimension.DURATION and every < camera.interval_us:
        found = f"pictures are due every {display(every, dimension)}, but the camera needs {least}"
        yield PictureFault(codes.HASTY_PICTURES, "every", found, "every", Accepted(camera.interval_us, dimension))
    if dimension is Dimension.LENGTH and time_for(every, speed) < camera.interval_us:
        due = display(time_for(every, speed) // _MILLISECOND * _MILLISECOND, Dimension.DURATION)
        found = f"at {display(speed, Dimension.SPEED)} pictures are due every {due}, but the camera needs {least}"
        fastest = _rounded(every * _SECOND_US // camera.interval_us, Dimension.SPEED)
        yield PictureFault(codes.HASTY_PICTURES, "every", found, "speed", fastest)


def _rounded(value: int, dimension: Dimension) -> Accepted | None:
    """Return an accepted value rounded down to a tenth of a metre or to a millisecond; None if it is not above zero."""
    step = _MILLISECOND if dimension is Dimension.DURATION else _TENTH
    return Accepted(value // step * step or value, dimension) if value > 0 else None


def _forward(camera: SurveyCamera, near: int, speed: int, pictures: PicturesDecl) -> int | None:
    """Return the least overlap of successive pictures on a leg."""
    every = pictures.every
    if every is None:
        return None
    passed = passed_in(speed, every.value) if every.dimension is Dimension.DURATION else every.value
    return overlap(camera.shows_along(near), passed)


# ------------------------------------------------------------------------------------------------- of a contract


def prove_survey_quality(proof: ProofContext) -> None:
    """Report every skill of a policy whose pictures may show less than it demands.

    A skill that the policy only forbids never flies, and a vehicle without the camera may import the rule.
    """
    permits = [rule for rule in proof.policy.rules if rule.kind == RuleKind.PERMIT]
    for number, contract in enumerate(proof.policy.contracts):
        skill = proof.skills[contract.name]
        if skill.pictures is None or not any(not rule.skills or number in rule.skills for rule in permits):
            continue
        camera = camera_named(proof.lowered.vehicle, skill.pictures)
        if camera is None:
            _no_camera(proof, skill.pictures)
            continue
        prove_commanded(proof, skill, skill.pictures, camera)
        for flown, fault in _of_contract(proof, skill, camera):
            _report(proof, skill, camera, flown, fault)


def _no_camera(proof: ProofContext, pictures: PicturesDecl) -> None:
    vehicle = proof.lowered.vehicle
    names = [each.name.text for each in vehicle.cameras]
    known = f"its cameras are {', '.join(f'`{name}`' for name in names)}" if names else (
        f"declare it, as in `camera {pictures.camera.text} sensor 13.2 mm by 8.8 mm focal 8.8 mm pixels 5472 by 3648 "
        "every at least 700 ms exposure at most 1 ms`"
    )  # fmt: skip
    proof.report.add(
        codes.UNKNOWN_CAMERA,
        pictures.camera.span,
        f"`{vehicle.name.text}` has no camera `{pictures.camera.text}`",
        help=suggestion(pictures.camera.text, names) or known,
        labels=[(vehicle.name.span, "the vehicle")],
    )


def _of_contract(proof: ProofContext, skill: SkillDecl, camera: CameraDecl) -> list[tuple[SurveyRange, PictureFault]]:
    """Return the faults of a contract in the worst case of its ranges, each once."""
    assert skill.pictures is not None
    found: dict[tuple[str, str], tuple[SurveyRange, PictureFault]] = {}
    for flown in _ranges(proof, skill, camera):
        for fault in faults(flown, skill.pictures):
            found.setdefault((fault.part, fault.change), (flown, fault))
    return list(found.values())


def _ranges(proof: ProofContext, skill: SkillDecl, camera: CameraDecl) -> Iterator[SurveyRange]:
    """Yield how a skill may be flown: looking down, and looking sideways."""
    motion, pictures = skill.motion, skill.pictures
    assert motion is not None
    assert pictures is not None
    patterns = _patterns(skill, motion)
    speed = 0 if motion.speed is None else _ends(proof, skill, motion.speed.text)[1]
    for sideways in (False, True):
        pattern = next((each for each in patterns if (each in SIDEWAYS) == sideways), None)
        seen = motion.distance if sideways else motion.altitude
        if pattern is None or seen is None:
            continue
        low, high = _ends(proof, skill, seen.text)
        if motion.lowest is not None and not sideways:
            low = min(low, _ends(proof, skill, motion.lowest.text)[0])
        relief = 0 if sideways else relief_of(pictures)
        yield SurveyRange(
            survey_camera(camera, pattern), max(low - relief, 0), high + relief,
            speed or proof.policy.vehicle.speed, seen.text, relief,
        )  # fmt: skip


def _patterns(skill: SkillDecl, motion: MotionDecl) -> list[str]:
    """Return the patterns among which a step may choose."""
    if motion.pattern is None:
        return [DEFAULT_PATTERN]
    return [choice.text for choice in _parameter(skill, motion.pattern.text).choices]


def _ends(proof: ProofContext, skill: SkillDecl, name: str) -> tuple[int, int]:
    """Return the range of a parameter."""
    argument = proof.context.arguments(skill)[name]
    return argument.low or 0, argument.high or 0


def _parameter(skill: SkillDecl, name: str) -> ParameterDecl:
    return next(each for each in skill.parameters if each.name.text == name)


class RangeEnd(NamedTuple):
    """What a fault would change: its span, and the least value that it may have."""

    span: Span
    least: int


def _limit(proof: ProofContext, skill: SkillDecl, flown: SurveyRange, fault: PictureFault) -> RangeEnd | None:
    """Return the end of the range that causes a fault, or the spacing; None if neither is written."""
    assert skill.motion is not None
    assert skill.pictures is not None
    if fault.change == "every":
        return None if skill.pictures.every is None else RangeEnd(skill.pictures.every.span, 0)
    speed = skill.motion.speed
    name = flown.seen if fault.change == "distance" else "" if speed is None else speed.text
    range = _parameter(skill, name).range if name else None
    return None if range is None else RangeEnd(range.high.span, _ends(proof, skill, name)[0])


def _least_size(skill: SkillDecl, name: str | None) -> int:
    """Return the least value that a size may be set to; 0 if that is not written as a value."""
    ranges = [each.range for each in skill.sizes if each.name.text == name and each.range is not None]
    return next((each.low.value for each in ranges if isinstance(each.low, Quantity)), 0)


def _report(proof: ProofContext, skill: SkillDecl, camera: CameraDecl, flown: SurveyRange, fault: PictureFault) -> None:
    """Report a fault at the end of the range that causes it, at the spacing, or else at the demand."""
    demand = getattr(skill.pictures, fault.part).span
    limit = _limit(proof, skill, flown, fault)
    span = demand if limit is None else limit.span
    size = named_at(proof.report, skill, span)
    least = 0 if limit is None else max(limit.least, _least_size(skill, size))
    accepted = fault.accepted if limit is not None and fault.accepted and fault.accepted.value >= least else None
    help = _CHANGE["no speed" if limit is None else "blur" if fault.part == "blur" else fault.change]
    if accepted is not None:
        text = f"write `sizes {skill.name.text}({size} = {accepted.text})`"
        help = text if size is not None else f"nearest accepted: `{accepted.text}`"
    at = f"at {display(flown.far - flown.relief, Dimension.LENGTH)} " if fault.change == "distance" else ""
    proof.report.add(
        fault.code,
        span,
        f"{at}{fault.found}",
        help=help,
        labels=[*([(demand, "demanded here")] if demand != span else []), (camera.span, "the camera")],
        fix=None if accepted is None or size is not None else (span, accepted.text, f"write `{accepted.text}`"),
    )


#: what to change where no value of a range keeps a demand
_CHANGE: Final = {
    "distance": "no value of the range keeps it: demand less, or declare a camera with a longer focal length",
    "every": "no spacing of the range keeps it: demand less, or raise the least height or distance",
    "speed": "no speed of the range keeps it: raise the spacing, or declare a camera with a shorter interval",
    "blur": "no speed of the range keeps it: demand less, raise the least height or distance, or declare a camera with "
    "a shorter exposure",
    "no speed": "the motion sets no speed, so the vehicle's greatest counts: give the motion a `speed` with a range",
}


# ---------------------------------------------------------------------------------------------------- of a step


def step_pictures(proof: ProofContext, declared: MissionDecl, mission: Mission) -> tuple[StepPictures, ...]:
    """Return the pictures of each step that states them, and report demands that its area does not allow."""
    steps = chain.from_iterable(phase.steps for phase in declared.phases)
    return tuple(
        found
        for step, flat in zip(steps, mission.invocations, strict=True)
        if (found := _of_step(proof, step, flat)) is not None
    )


def _of_step(proof: ProofContext, step: Step, flat: Invocation) -> StepPictures | None:
    skill = proof.skills[flat.contract.name]
    pictures, vehicle = skill.pictures, proof.policy.vehicle
    camera = camera_named(proof.lowered.vehicle, pictures)
    if pictures is None or camera is None or flat.plan.kind != MotionKind.COVER:
        return None
    bound = proof.context.bound(step)
    plan = survey_plan(skill, bound, flat.plan.lowest, proof.lowered.zones, proof.lowered.vehicle)
    seen = survey_camera(camera, plan.pattern)
    near, far = _distances(plan, pictures, flat.plan.altitude)
    flown = SurveyRange(seen, near, far, flat.plan.speed or vehicle.speed)
    if plan.pattern in SIDEWAYS:
        between = max((abs(b - a) for a, b in pairwise(flat.plan.heights)), default=None)
    else:
        between = line_spacing(plan.shape, plan.pattern, plan.height, vehicle.position_error, plan.aim)
    told = _numbers(flat, camera.name.text, plan.pattern, flown, pictures, between)
    if not _of_contract(proof, skill, camera):
        _report_step(proof, step, skill, plan, flown, told)
    return told


def _distances(plan: SurveyPlan, pictures: PicturesDecl, highest: int) -> tuple[int, int]:
    """Return the least and the greatest distance of a step, whose plan is at its lowest height, to what it sees."""
    away = plan.aim.distance
    hole = structure_of(plan.shape) if plan.pattern == AROUND else None
    if hole is not None:
        return away, around_reach(hole, away)
    if plan.pattern in SIDEWAYS:
        return away, away + 1
    return max(plan.height - relief_of(pictures), 0), highest + relief_of(pictures)


def _numbers(
    flat: Invocation, camera: str, pattern: str, flown: SurveyRange, pictures: PicturesDecl, between: int | None
) -> StepPictures:
    seen, near, far, speed = flown[:4]
    path = path_length(list(zip(flat.plan.path[::2], flat.plan.path[1::2], strict=True)))
    every = pictures.every
    count = interval = None
    if every is not None:
        in_time = every.dimension is Dimension.DURATION
        interval = every.value if in_time else time_for(every.value, speed)
        count = int(path // (passed_in(speed, every.value) if in_time else every.value)) + 1
    return StepPictures(
        step_number=flat.step + 1,
        skill=flat.contract.name,
        camera=camera,
        pattern=pattern,
        pixel_um=_pixel_um(seen, far),
        along=int(seen.shows_along(near)),
        across=int(seen.shows_across(near)),
        forward=_forward(seen, near, speed, pictures),
        lines_apart=between,
        side=None if between is None else overlap(seen.shows_across(near), between),
        blur=seen.blur(speed, near),
        interval_us=interval,
        pictures=count,
    )


def _report_step(
    proof: ProofContext, step: Step, skill: SkillDecl, plan: SurveyPlan, flown: SurveyRange, told: StepPictures
) -> None:
    """Report what a step's area does not allow."""
    pictures, motion = skill.pictures, skill.motion
    assert pictures is not None
    assert motion is not None
    for fault in faults(flown, pictures):
        at = motion.distance or motion.target
        assert at is not None
        proof.report.add(
            fault.code,
            argument_span(proof.context, step, at.text),
            f"around `{plan.zone.name.text}` {fault.found}",
            help="fly nearer to the structure, or divide it into zones that are rounder",
            labels=[(getattr(pictures, fault.part).span, "demanded here"), (plan.zone.name.span, "declared here")],
        )
    side = None if pictures.side is None else pictures.side.value
    if side is None or told.side is None or told.side >= side:
        return
    assert motion.target is not None
    apart_by = display(told.lines_apart or 0, Dimension.LENGTH)
    lines, at = f"the lines over `{plan.zone.name.text}`", motion.target
    help = "a path has at most 256 lines: divide the zone, or fly higher"
    if plan.pattern in SIDEWAYS:
        widest = display(apart(Fraction(told.across), side), Dimension.LENGTH)
        lines, at, help = "its heights", motion.every or at, f"fly at heights that are at most {widest} apart"
    proof.report.add(
        codes.SMALL_OVERLAP,
        argument_span(proof.context, step, at.text),
        f"{lines} are {apart_by} apart, and neighbouring pictures overlap {_percent(told.side)}, "
        f"less than {_percent(side)}",
        help=help,
        labels=[(pictures.side.span if pictures.side else step.span, "demanded here"),
                (plan.zone.name.span, "declared here")],
    )  # fmt: skip


# ------------------------------------------------------------------------------------------------------ as text


def pictures_text(one: StepPictures) -> str:
    """Return the pictures of a step in words."""
    sizes = f"{display(one.across, Dimension.LENGTH)} by {display(one.along, Dimension.LENGTH)}"
    parts = [f"{micrometres(one.pixel_um)} per pixel", f"pictures of {sizes}"]
    shares = [(one.forward, "forward"), (one.side, "side")]
    overlaps = [f"{_percent(share)} {way}" for share, way in shares if share is not None]
    parts += [f"overlap {', '.join(overlaps)}"] if overlaps else []
    parts += [f"blur {_percent(one.blur)} of a pixel"]
    parts += [f"{one.pictures} pictures"] if one.pictures is not None else []
    return f"{one.camera}, {one.pattern}: {', '.join(parts)}"


def _pixel_um(camera: SurveyCamera, away: int) -> int:
    """Return what a pixel shows in um, rounded up."""
    shows = camera.sample_distance(away) * 1_000
    return -(-shows.numerator // shows.denominator)


def _percent(share: int) -> str:
    return display(share, Dimension.RATIO)
