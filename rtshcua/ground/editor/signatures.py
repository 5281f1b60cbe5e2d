"""What a call takes, while it is written."""

from typing import NamedTuple

from rtshcua.ground.editor.desk import View
from rtshcua.ground.editor.pieces import Cut
from rtshcua.ground.editor.places import before, call_of, sizing
from rtshcua.ground.editor.syntax import note_before
from rtshcua.model.ir.skills import SkillDecl


class Signature(NamedTuple):
    """The call as it is declared, its parameters as they are written there, and which of them is being given."""

    label: str
    parameters: tuple[str, ...]
    active: int
    note: str


def signature(view: View, cut: Cut, offset: int) -> Signature | None:
    """The skill or template whose arguments a place is among."""
    since = max((piece.start for piece in cut.pieces if piece.firm and piece.start <= offset), default=0)
    call = call_of(before(cut.source.text, offset, since))
    if call is None:
        return None
    declared = view.symbols.skills.get(call.name) or view.symbols.templates.get(call.name)
    if declared is None:
        return None
    wanted = declared.parameters
    if isinstance(declared, SkillDecl) and sizing(before(cut.source.text, offset, since)):
        wanted = declared.sizes
    parameters = tuple(" ".join(view.slice(each.span).split()) for each in wanted)
    names = [each.name.text for each in wanted]
    active = names.index(call.argument) if call.argument in names else call.position
    note = note_before(view.text(declared.span.file), declared.span.start)
    return Signature(f"{call.name}({', '.join(parameters)})", parameters, min(active, len(names)), note)
