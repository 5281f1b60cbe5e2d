"""Check the cameras of vehicles, and what skills demand of pictures; `ground/prove/survey_quality.py` proves it."""

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.fields import quantity
from rtshcua.model.flat.limits import FULL
from rtshcua.model.ir.expression import Quantity
from rtshcua.model.ir.places import CameraDecl
from rtshcua.model.ir.skills import PicturesDecl, SkillDecl
from rtshcua.model.quantity import Dimension

#: the most pixels on one side of a sensor
MOST_PIXELS = 100_000
#: the longest interval and exposure of a camera, us
MOST_INTERVAL_US = 3_600_000_000
#: the greatest blur that a skill may permit: 100 pixels, in 1/10000
MOST_BLUR = 100 * FULL


def check_survey_demands(context: CheckContext) -> None:
    """Report every field of a camera and of `pictures` with a wrong dimension or value."""
    for vehicle in context.symbols.vehicles.values():
        first: dict[str, Span] = {}
        for camera in vehicle.cameras:
            name = camera.name.text
            if name in first:
                context.report.add(
                    codes.WRITTEN_TWICE,
                    camera.name.span,
                    f"the camera `{name}` is repeated in `{vehicle.name.text}`",
                    help="give each camera a name of its own",
                    labels=[(first[name], "first declared here")],
                )
            first.setdefault(name, camera.name.span)
            _camera(context, camera)
    for skill in context.symbols.skills.values():
        if skill.pictures is not None:
            _pictures(context, skill, skill.pictures)


def _camera(context: CheckContext, camera: CameraDecl) -> None:
    for pixels in (camera.columns, camera.rows):
        quantity(context, pixels, Dimension.COUNT, most=MOST_PIXELS)
    for time in (camera.interval, camera.exposure):
        quantity(context, time, Dimension.DURATION, most=MOST_INTERVAL_US)


def _pictures(context: CheckContext, skill: SkillDecl, pictures: PicturesDecl) -> None:
    every = pictures.every
    quantity(context, every, Dimension.DURATION if _is_time(every) else Dimension.LENGTH)
    if isinstance(pictures.resolution, Quantity):
        quantity(context, pictures.resolution, Dimension.LENGTH)
    quantity(context, pictures.relief, Dimension.LENGTH, positive=False)
    quantity(context, pictures.blur, Dimension.RATIO, most=MOST_BLUR)
    for share in (pictures.forward, pictures.side):
        quantity(context, share, Dimension.RATIO, positive=False, most=FULL - 1)
    if skill.motion is not None and skill.motion.kind != "cover":
        context.report.add(
            codes.BAD_PICTURES,
            pictures.span,
            f"`{skill.name.text}` does not fly a survey, so its pictures have no footprint and no overlap",
            help="write `pictures` in a skill whose motion is `cover`",
            labels=[(skill.motion.span, "the motion")],
        )
    spaced = every is not None or any(each.part == "every" for each in skill.sized)
    if not spaced and pictures.forward is not None and pictures.forward.value:
        context.report.add(
            codes.BAD_PICTURES,
            pictures.forward.span,
            "an overlap forward needs the spacing of the pictures",
            help="write `every` after the camera, as in `every 10 m` or `every 2 s`",
            labels=[(pictures.camera.span, "no spacing is stated for this camera")],
        )


def _is_time(every: Quantity | None) -> bool:
    return every is not None and every.dimension is Dimension.DURATION
