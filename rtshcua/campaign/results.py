"""What came of the flights of a campaign: one line of JSON a flight, in whatever order they were flown.

A campaign that was interrupted goes on from its lines; one that was torn in the middle counts as not flown.
"""

from collections.abc import Iterable
from typing import Final

import msgspec

from rtshcua.campaign.drawing import CampaignTally, Moment


class JudgeFinding(msgspec.Struct, frozen=True):
    """What the judge found, or what it excused: `why` says what in the flight allows it."""

    slug: str
    text: str
    at_us: int = 0
    why: str = ""


class CampaignResult(msgspec.Struct, frozen=True):
    """One flight. `tries` are pairs of a kind of fault and the state change it was near; `margins` the judge's numbers.

    `moments` are the state changes that were seen. `took_us` is processor time; it is the only thing that is not the
    same when it is flown again.
    """

    number: int
    flavour: str
    seed: int
    incidents: tuple[str, ...]
    tries: tuple[tuple[str, str], ...]
    ending: str
    failures: tuple[JudgeFinding, ...]
    exceptions: tuple[JudgeFinding, ...]
    margins: dict[str, int]
    moments: tuple[tuple[str, int], ...]
    flown_us: int
    log: str
    """SHA-256 of the flight's log, in hexadecimal."""
    took_us: int = 0


#: how many times of a state change are kept, the first that were seen
_KEPT: Final = 40
_DECODER: Final = msgspec.json.Decoder(CampaignResult)


def result_line(result: CampaignResult) -> bytes:
    """As it is kept."""
    return msgspec.json.encode(result) + b"\n"


def read_results(lines: Iterable[bytes]) -> dict[int, CampaignResult]:
    """What was kept, by number; a line that is no result is left out."""
    found: dict[int, CampaignResult] = {}
    for each in lines:
        try:
            result = _DECODER.decode(each)
        except msgspec.MsgspecError:
            continue
        found[result.number] = result
    return found


def tally(results: Iterable[CampaignResult]) -> CampaignTally:
    """What the next round is drawn by: of results in the order of their numbers."""
    made = CampaignTally()
    seen: dict[tuple[str, str], int] = {}
    for result in results:
        moments = made.moments.setdefault(result.flavour, [])
        for label, at_us in result.moments:
            count = seen.get((result.flavour, label), 0)
            if count < _KEPT:
                seen[result.flavour, label] = count + 1
                moments.append(Moment(label, at_us))
        for pair in result.tries:
            made.tried[pair] = made.tried.get(pair, 0) + 1
    return made
