"""How cars really go through crossings: what the recognised turns are compared with."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.sim_uavs.roads.drivers import RoadState

TURNS = {"left": "turn_left_in_crossing", "right": "turn_right_in_crossing", "straight": "straight_through_crossing"}
"""By what the map calls a way through a crossing, the chronicle that is of it."""


class Passage(NamedTuple):
    """A car came from one link through a crossing onto another; `at_us` is when it was there."""

    at_us: int
    car: str
    come: str
    crossing: str
    gone: str


def passages(at: Callable[[int], list[RoadState] | None], times_us: Iterable[int]) -> list[Passage]:
    """All passages between the times, which are in order and not far apart."""
    came: dict[str, str] = {}
    crossed: dict[str, str] = {}
    found = []
    for now_us in times_us:
        for state in at(now_us) or ():
            if state.crossing is not None:
                crossed[state.name] = state.crossing
            elif state.link is not None:
                if state.name in crossed and state.name in came:
                    found.append(Passage(now_us, state.name, came[state.name], crossed[state.name], state.link))
                crossed.pop(state.name, None)
                came[state.name] = state.link
    return found


def chronicle_of(network: RoadNetwork, passage: Passage) -> str | None:
    """Which chronicle is of it; None: it turned round."""
    turns = network.turns.attributes(passage.come)
    way = passage.crossing, passage.gone
    return next((name for turn, name in TURNS.items() if way in turns[turn]), None)
