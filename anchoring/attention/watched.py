"""What attention knows of objects: the places where each may be, and why it is of interest."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from math import sqrt
from typing import Literal, NamedTuple, TypeAlias

from anchoring.links.objects import LinkObject
from anchoring.links.specification import LinkSpecification
from anchoring.links.states import ObjectState
from anchoring.links.structures import ObjectLinkage

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
    """

    symbol: str
    places: tuple[WatchedPlace, ...]
    seen_us: int
    is_anchored: bool
    interest: Interest = "known"


def place_of(state: ObjectState, weight: float = 1.0) -> WatchedPlace:
    """A state as a place to look at."""
    sd_m = sqrt(max(float(state.covariance[0, 0] + state.covariance[1, 1]), 0.0))
    return WatchedPlace(state.x_m, state.y_m, state.vx_m_s, state.vy_m_s, sd_m, weight)


def watched(
    linkage: ObjectLinkage, specifications: Sequence[LinkSpecification], followed: Collection[str] = ()
) -> Iterator[WatchedObject]:
    """One object of each structure, the highest, with the hypotheses about it; percepts that are linked to nothing.

    A structure that has a followed symbol in it is followed.
    """
    targets = dict.fromkeys(each.target for each in specifications)
    divided = {each.source for each in specifications if each.exclusive}
    for type_ in linkage.percept_types:
        for one in linkage.objects(type_).values():
            if not one.outgoing:
                yield _watched(one, "new", is_anchored=True)
    for type_ in targets:
        for one in linkage.objects(type_).values():
            if one.outgoing:
                continue
            interest: Interest = "undecided" if type_ in divided else "known"
            if followed and not {one.symbol, *_below(one)}.isdisjoint(followed):
                interest = "followed"
            yield _watched(one, interest, is_anchored=linkage.anchored(one.symbol))


def _watched(one: LinkObject, interest: Interest, *, is_anchored: bool) -> WatchedObject:
    seen_us = one.observed[-1].valid_us if one.observed else one.created_us
    places = tuple(place_of(state, weight) for state, weight in one.whereabouts.hypotheses)
    return WatchedObject(one.symbol, places, seen_us, is_anchored, interest)


def _below(one: LinkObject) -> Iterable[str]:
    for link in one.incoming.values():
        yield link.source.symbol
        yield from _below(link.source)
