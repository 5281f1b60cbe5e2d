"""The words of a handbook that have a meaning of their own."""

from typing import Final, NamedTuple


class Entry(NamedTuple):
    """A word, and what it means here."""

    word: str
    meaning: str


GLOSSARY: Final = (
    Entry("above home", "Height over the place where the vehicle starts, not over the ground below it."),
    Entry("agent", "A program that proposes missions. It can ask for what is permitted to it, and command nothing."),
    Entry("airspace", "Where the vehicle may be at all, whatever it is asked to do."),
    Entry("charge", "How full the battery is. What a skill may take of it is a bound that counts in the checks."),
    Entry("contingency", "What flies when a step is denied while the vehicle is in the air."),
    Entry(
        "digest",
        "A number computed from everything that is signed. If one letter of it is changed, the digest is another; so "
        "two documents with the same digest say the same.",
    ),
    Entry("fallback", "What flies when a step that was allowed cannot go on: the chain of its skill, in order."),
    Entry("forbid", "A rule that denies. It outweighs every permit."),
    Entry("mission", "An ordered list of steps, proposed for a role, and checked against the policy before it flies."),
    Entry("permit", "A rule that allows. What no permit allows is denied."),
    Entry("phase", "A named stretch of a mission, such as departure."),
    Entry("policy", "The rules of one vehicle: who may have what done, where and when. Its version only rises."),
    Entry("role", "On whose behalf something is asked for, such as operator or supervisor."),
    Entry("signal", "Something that the vehicle reports about itself or its surroundings."),
    Entry("skill", "Something that the vehicle can do, with its limits. Nothing else can be asked of it."),
    Entry("source", "What speaks for a role: a person at the controls, an agent, software on board, a reflex."),
    Entry(
        "unknown",
        "A signal that was never received, is too old, or says that it does not know. What is unknown permits nothing: "
        "a permit that needs it does not hold, a prohibition that needs it makes the step wait, an approval that "
        "hangs on it must be given, and a rule that would fly something else makes the step wait.",
    ),
    Entry(
        "zone", "An area on the ground with, perhaps, a floor, a ceiling and times. Its border does not belong to it."
    ),
)
