"""What an import leaves out. A *loss* is a part of the file that the source does not have, and that changes neither
where the vehicle flies nor where a zone is. What would change that is *not kept*: the import is refused, unless a
person leaves that part out by its name.

Names of losses are stable. Places are JSON pointers (RFC 6901), or elements of a KML document.
"""

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Final, NamedTuple

from rtshcua.diagnostics.excerpt import visible

#: the consequence of each loss, by its name
LOSSES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "acceptance-radius": "the autopilot's own radius decides when a waypoint is reached",
        "added-takeoff": "the plan does not take off: a climb to the first height is added",
        "breach-return": "the policy decides what happens at a fence, not this place",
        "camera": "no picture or video is taken, and the camera keeps its settings",
        "camera-figures": "the plan does not state it: the written one is made up, replace it by your camera's",
        "camera-trigger": "pictures are requested from a MAVLink camera, not by the trigger of the autopilot",
        "condition": "a later command is not delayed",
        "fence": "the airspace of the given policy applies, not the plan's fence",
        "fence-switch": "the airspace applies to the whole flight",
        "gimbal": "the gimbal is not turned",
        "height-above-terrain": "the height above sea that the planner computed is kept, and not computed again",
        "height-datum": "the height above sea is written as a height above home, by the elevation of home",
        "hover-and-capture": "the vehicle takes pictures without a stop",
        "landing-options": "the vehicle lands without a precision landing or an abort height",
        "marker": "it only marks a place in the plan",
        "no-fence": "the plan has no area to stay inside: the zone around its places is made up",
        "payload": "the payload is not operated",
        "planned-home": "heights count from the home of the given policy, and the vehicle returns there",
        "planned-speed": "legs without a change of speed are flown with the skill's default, not with this speed",
        "rally-points": "the vehicle returns to home, not to a rally point",
        "region-of-interest": "the vehicle does not turn towards the place",
        "structure-round": "the vehicle flies on a circle around the structure, nowhere nearer than planned",
        "survey-lines": "the compiler plans the path again: direction, order and begin of the lines are its own",
        "survey-parameters": "the planned legs are kept; area, spacing, overlap and camera are not",
        "takeoff-place": "the vehicle climbs where it stands, as ArduCopter does",
        "turnaround": "the vehicle turns inside of the area, not beyond its edge",
        "vehicle-type": "the steps are for a multicopter, whatever vehicle the plan is for",
        "vertical-speed": "the vehicle climbs and descends with its own speeds",
        "vtol": "there is no transition: the steps are for a multicopter",
        "yaw": "the heading is the autopilot's choice",
        # of zones
        "authority": "the import knows no authorisation: the zone is excluded, also for those who have one",
        "conditions": "the conditions are a comment; the zone is excluded whether they are met or not",
        "description": "texts and other data are not kept",
        "no-height": "the file gives no height: the zone reaches from the ground to any height",
        "point": "a point is no area",
        "style": "colours, icons, views and overlays are not kept",
        "time-stamp": "the zone is not limited to this moment",
        "track": "a flown track is no area",
        "widened": "a height above ground is written above sea, on the safe side of the stated terrain",
    }
)


class Loss(NamedTuple):
    """A loss: its name of `LOSSES`, its place in the file, and what the file has there."""

    name: str
    place: str
    what: str


class NotKept(NamedTuple):
    """A part that cannot be kept: its name, its place in the file, the reason, and what a person can do."""

    name: str
    place: str
    why: str
    help: str = ""


class NotReadable(Exception):
    """A file that is not of its format: the text and the help are for people."""

    def __init__(self, text: str, help: str = "") -> None:
        super().__init__(text)
        self.help = help


class LossGroup(NamedTuple):
    """The losses of one name: the consequence, and where they are."""

    name: str
    consequence: str
    losses: tuple[Loss, ...]


def grouped(losses: Iterable[Loss]) -> list[LossGroup]:
    """Losses by name, in the order of their first appearance."""
    found: dict[str, list[Loss]] = {}
    for each in losses:
        found.setdefault(each.name, []).append(each)
    return [LossGroup(name, LOSSES[name], tuple(some)) for name, some in found.items()]


def left_out(found: Sequence[NotKept], skip: Sequence[str]) -> tuple[list[NotKept], list[NotKept], list[str]]:
    """Divide parts into those that remain refused and those that a person left out by `skip`: names, places, or `all`.
    Also the words of `skip` that name nothing.
    """
    if "all" in skip:
        return [], list(found), []
    named = [each for each in found if each.name in skip or each.place in skip]
    unknown = [word for word in skip if not any(word in (each.name, each.place) for each in found)]
    return [each for each in found if each not in named], named, unknown


def comment(text: str) -> str:
    """A text from outside as part of a comment: one line, nothing invisible, and not longer than is useful."""
    shown = visible(" ".join(text.split()))
    return shown if len(shown) <= 90 else shown[:87] + "..."
