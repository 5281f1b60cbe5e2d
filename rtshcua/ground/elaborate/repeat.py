"""`repeat N { ... }` becomes its steps, N times over."""

from collections.abc import Iterator, Sequence

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.report import Report
from rtshcua.model.flat.limits import MAX_INVOCATIONS
from rtshcua.model.ir.missions import Item, MissionDecl, Repeat, Step


def unrolled(report: Report, mission: MissionDecl) -> MissionDecl:
    """The mission with steps alone; where its repetitions are too many or none, each is taken once, and reported."""
    repeats = [item for phase in mission.phases for item in _repeats(phase.items)]
    if not repeats:
        return mission
    good = not [repeat for repeat in repeats if not _counts(report, repeat)]
    total = sum(_total(phase.items) for phase in mission.phases) if good else 0
    if total > MAX_INVOCATIONS:
        good = False
        most = max(repeats, key=lambda repeat: repeat.count.value * _total(repeat.items))
        report.add(
            codes.MISSION_STEPS,
            mission.name.span,
            f"the mission `{mission.name.text}` has {total} steps, and at most {MAX_INVOCATIONS} fit on board",
            help="repeat less, or split it into several missions",
            labels=[(most.count.span, f"these are {most.count.value * _total(most.items)} steps")],
        )
    phases = tuple(phase.copied(items=tuple(_steps(phase.items, once=not good))) for phase in mission.phases)
    return mission.copied(phases=phases)


def _repeats(items: Sequence[Item]) -> Iterator[Repeat]:
    for item in items:
        if isinstance(item, Repeat):
            yield item
            yield from _repeats(item.items)


def _counts(report: Report, repeat: Repeat) -> bool:
    """Whether a repetition says how often; reports it where it does not."""
    count = repeat.count
    if count.value < 1:
        report.add(
            codes.NOT_POSITIVE,
            count.span,
            f"`{report.text(count.span)}` must be above zero",
            help="what is never done is left out",
        )
        return False
    return True


def _total(items: Sequence[Item]) -> int:
    """How many steps there are, counted without making them."""
    return sum(1 if isinstance(item, Step) else item.count.value * _total(item.items) for item in items)


def _steps(items: Sequence[Item], *, once: bool) -> Iterator[Step]:
    """The steps in order. Each is a node of its own: what is found out about a step is kept by its identity."""
    for item in items:
        if isinstance(item, Step):
            yield item.copied()
        else:
            for _ in range(1 if once else item.count.value if _total(item.items) else 0):
                yield from _steps(item.items, once=once)
