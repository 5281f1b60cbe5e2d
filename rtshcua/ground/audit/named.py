"""What a record is about, in words: a step by its number, a link of a chain by its place, both from 1."""

from rtshcua.evidence.records import Effect
from rtshcua.model.step_number import step_words
from rtshcua.wire.permit import WITHDRAWN
from rtshcua.wire.request import CONTINGENCY_LINK, DEGRADE, FALLBACK_LINK, STEP, Ref


def ref_words(ref: Ref) -> str:
    """A step or link in words; the fields of the record where they are about neither."""
    match ref:
        case Ref(kind=kind, step=step, link=-1) if kind == STEP and step >= 0:
            return step_words(step)
        case Ref(kind=kind, step=step, link=link) if kind == FALLBACK_LINK and step >= 0 and link >= 0:
            return f"link {link + 1} of the fallback of {step_words(step)}"
        case Ref(kind=kind, step=step, link=link) if kind == FALLBACK_LINK and step >= 0 and link == DEGRADE:
            return f"the target of a degrade rule, at {step_words(step)}"
        case Ref(kind=kind, step=-1, link=link) if kind == CONTINGENCY_LINK and link >= 0:
            return f"link {link + 1} of the contingency"
        case _:
            return f"neither a step nor a link: kind {ref.kind}, index {ref.step}, link {ref.link}"


def is_withdrawn(record: Effect) -> bool:
    """Whether an effect says that nothing was sent of a step that was admitted, so that it may come again."""
    return record.event == "refused" and record.detail == WITHDRAWN
