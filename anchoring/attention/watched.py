"""Objects as attention sees them: the places where each may be, and why it is of interest."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from math import sqrt
from typing import Final, Literal, NamedTuple, TypeAlias

from dyknow import US_PER_S
from dyknow.anchoring.links.objects import LinkObject
from dyknow.anchoring.links.specification import LinkSpecification
from dyknow.anchoring.links.states import ObjectState
from dyknow.anchoring.links.structures import ObjectLinkage

LONGEST_US: Final = 2 * US_PER_S
"""How far beyond its last state an object is taken to move on."""

AHEAD_US: Final = 2 * US_PER_S
"""A camera that turns away from an object is back after so long, or later."""

Interest: TypeAlias = Literal["known", "new", "undecided", "wanted", "followed"]
"""`new`: a percept that is no object yet; `undecided`: an object whose type exclusive links have not decided."""


class WatchedPlace(NamedTuple):
    """Where an object may be: metres east and north, metres per second.

    Attributes:
        sd_m: along its velocity, or to all sides where it has none.
        weight: how probable; those of one object sum to 1.
    """

    x_m: float
    y_m: float
    vx_m_s: float = 0.0
    vy_m_s: float = 0.0
    sd_m: float = 1.0
    weight: float = 1.0


class WatchedObject(NamedTuple):
    """An object, or a percept, at one time.

    Attributes:
        places: the most probable first; none for a wanted object that may be anywhere.
        seen_us: when a percept showed it last.
        is_anchored: a percept shows it.
        ahead_m: how far its places will be spread `AHEAD_US` after that, if nothing shows it until then.
    """

    symbol: str
    places: tuple[WatchedPlace, ...]
    seen_us: int
    is_anchored: bool
    interest: Interest = "known"
    ahead_m: float = 0.0


def moved_on(place: WatchedPlace, valid_us: int, now_us: int) -> WatchedPlace:
    """The place a little later, at its velocity; `LONGEST_US` at most."""
    seconds = min(max(now_us - valid_us, 0), LONGEST_US) / US_PER_S
    return place._replace(x_m=place.x_m + seconds * place.vx_m_s, y_m=place.y_m + seconds * place.vy_m_s)


def place_of(state: ObjectState, weight: float = 1.0) -> WatchedPlace:
    """A state as a place to look at."""
    sd_m = sqrt(max(float(state.covariance[0, 0] + state.covariance[1, 1]), 0.0))
    return WatchedPlace(state.x_m, state.y_m, state.vx_m_s, state.vy_m_s, sd_m, weight)


def spread_m(places: Sequence[WatchedPlace]) -> float:
    """How far an object may be from its likeliest place: errors along the way, and the other hypotheses."""
    if not places:
        return 0.0
    likely = places[0]
    square = sum(
        each.weight * (each.sd_m**2 + (each.x_m - likely.x_m) ** 2 + (each.y_m - likely.y_m) ** 2) for each in places
    )
    return float(square**0.5)


def watched(
    linkage: ObjectLinkage,
    specifications: Sequence[LinkSpecification],
    followed: Collection[str] = (),
    now_us: int | None = None,
) -> Iterator[WatchedObject]:
    """One object of each structure, the highest, with the hypotheses about it; percepts that are linked to nothing; wanted ones.

    A structure that has a followed object in it is followed.

    Args:
        linkage: the structures.
        specifications: those of its links.
        followed: symbols.
        now_us: when places are wanted; None: as they were predicted or seen last.
    """
    targets = dict.fromkeys(each.target for each in specifications)
    divided = {each.source for each in specifications if each.exclusive}
    for type_ in linkage.percept_types:
        for one in linkage.objects(type_).values():
            if not one.outgoing:
                yield _watched(one, "new", now_us, is_anchored=True)
    for type_ in targets:
        for one in linkage.objects(type_).values():
            if one.outgoing:
                continue
            interest: Interest = "undecided" if type_ in divided else "known"
            if followed and not {one.symbol, *_below(one, linkage.percept_types)}.isdisjoint(followed):
                interest = "followed"
            ahead = linkage.foreseen(one, one.state.valid_us + AHEAD_US).hypotheses
            yield _watched(one, interest, now_us, is_anchored=linkage.anchored(one.symbol))._replace(
                ahead_m=spread_m([place_of(state, weight) for state, weight in ahead])
            )
    for symbol in linkage.wanted:
        yield WatchedObject(symbol, (), 0, is_anchored=False, interest="wanted")


def _watched(one: LinkObject, interest: Interest, now_us: int | None, *, is_anchored: bool) -> WatchedObject:
    seen_us = one.observed[-1].valid_us if one.observed else one.created_us
    hypotheses = one.whereabouts.hypotheses
    places = tuple(
        moved_on(place_of(state, weight), state.valid_us, state.valid_us if now_us is None else now_us)
        for state, weight in hypotheses
    )
    return WatchedObject(one.symbol, places, seen_us, is_anchored, interest)


def _below(one: LinkObject, percepts: Collection[str]) -> Iterable[str]:
    """The objects that it is linked to, without percepts: their symbols do not last."""
    for link in one.incoming.values():
        if link.source.type not in percepts:
            yield link.source.symbol
            yield from _below(link.source, percepts)
