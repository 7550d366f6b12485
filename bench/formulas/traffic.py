"""Cars that overtake each other, as events: the input of b07, from a seed."""

import random
from collections.abc import Iterator
from heapq import heapify, heapreplace

from dyknow.reasoning.chronicles import (
    ANY,
    Chronicle,
    ChronicleFile,
    ChronicleVariable,
    Distance,
    Event,
    EventType,
    Interval,
    NoEvent,
    Parameter,
    TimeOrder,
    TimePoint,
)

Change = tuple[int, str, tuple[str, ...], str | None, str]
"""(time in ms, attribute, arguments, old value, new value)."""

Step = tuple[int, str, str, str]
"""(time until the next in ms, attribute, old value, new value) of a car."""

_RELATIONS = ("behind", "left", "in_front")
_CAR1, _CAR2, _ROAD = ChronicleVariable("car1"), ChronicleVariable("car2"), ChronicleVariable("road")


def overtake() -> ChronicleFile:
    """The chronicle of Example 8.3.13."""
    t1, t2, t3, t4, t5 = (TimePoint(f"t{number}") for number in range(1, 6))
    both = (_CAR1, _CAR2)
    return ChronicleFile(
        (
            Chronicle(
                "overtake",
                both,
                (),
                (
                    Event(_type("behind", both, ANY, "true"), t1),
                    Event(_type("left", both, "false", "true"), t2),
                    Event(_type("in_front", both, "false", "true"), t3),
                    Event(_type("road", (_CAR1,), ANY, _ROAD), t4),
                    NoEvent(_type("road", (_CAR1,), _ROAD, ANY), t4, t3),
                    Event(_type("road", (_CAR2,), ANY, _ROAD), t5),
                    NoEvent(_type("road", (_CAR2,), _ROAD, ANY), t5, t3),
                    TimeOrder((t4, t1), ("<=",)),
                    TimeOrder((t5, t1), ("<=",)),
                    TimeOrder((t1, t2), ("<=",)),
                    Distance("t3", "t2", Interval(0, 60_000)),
                ),
            ),
        )
    )


def _type(name: str, arguments: tuple[Parameter, ...], old: Parameter, new: Parameter) -> EventType:
    return EventType(name, arguments, (old, new))


def changes(cars: int, count: int, seed: int = 1, roads: int = 4) -> Iterator[Change]:
    """Changes of the relations of pairs, one after the other, and now and then a car that turns to another road.

    A pair that is apart comes to be behind, then mostly left and in front, sometimes apart again.
    """
    rng = random.Random(seed)
    names = [f"car{number}" for number in range(cars)]
    on = {name: f"road{rng.randrange(roads)}" for name in names}
    relation: dict[tuple[str, str], int] = {}
    now_ms, made = 0, 0
    for name, road in on.items():
        yield now_ms, "road", (name,), None, road
    while made < count:
        now_ms += rng.randrange(1, 20)
        if rng.random() < 0.02:
            name = rng.choice(names)
            road = f"road{rng.randrange(roads)}"
            if road != on[name]:
                yield now_ms, "road", (name,), on[name], road
                on[name], made = road, made + 1
            continue
        first, second = rng.sample(names, 2)
        pair = (first, second)
        old = relation.get(pair)
        new = 0 if old is None else (old + 1) % 3 if rng.random() < 0.8 else 0
        if new == old:
            continue
        if old is not None:
            yield now_ms, _RELATIONS[old], pair, "true", "false"
            made += 1
        yield now_ms, _RELATIONS[new], pair, "false", "true"
        relation[pair], made = new, made + 1


def turns(cars: int, count: int, seed: int = 1, crossings: int = 20) -> Iterator[Change]:
    """Cars that drive from link to link through crossings; each crossing joins four links, of which some turn left.

    One car in five is not seen in the crossing, one in ten is seen to enter it twice (Figure 8.8).
    """
    rng = random.Random(seed)
    for crossing in range(crossings):
        for side in range(4):
            triple = (f"l{crossing}_{side}", f"x{crossing}", f"l{(crossing + 1 + side) % crossings}_{(side + 1) % 4}")
            yield 0, "links.left", triple, None, "true"
    on = {f"car{number}": (rng.randrange(crossings), rng.randrange(4)) for number in range(cars)}
    for car, (crossing, side) in on.items():
        yield 0, "cars.link", (car,), None, f"l{crossing}_{side}"
        yield 0, "cars.crossing", (car,), None, "no_crossing"
    nothing = tuple[Step, ...]()
    due = [(rng.randrange(1, 10_000), number, name, iter(nothing)) for number, name in enumerate(on)]
    heapify(due)
    for _ in range(count):
        now_ms, number, car, steps = due[0]
        step = next(steps, None)
        if step is None:
            steps = iter(_through(car, on, crossings, rng))
            heapreplace(due, (now_ms + rng.randrange(2_000, 20_000), number, car, steps))
            continue
        after_ms, name, old, new = step
        yield now_ms, name, (car,), old, new
        heapreplace(due, (now_ms + after_ms, number, car, steps))


def _through(car: str, on: dict[str, tuple[int, int]], crossings: int, rng: random.Random) -> Iterator[Step]:
    """The steps of a car that leaves its link for another."""
    crossing, side = on[car]
    turned = rng.choice(((side + 1) % 4, side))
    old, new = f"l{crossing}_{side}", f"l{(crossing + 1 + side) % crossings}_{turned}"
    on[car] = ((crossing + 1 + side) % crossings, turned)
    if rng.random() < 0.2:
        yield 1, "cars.link", old, new
        return
    yield rng.randrange(1, 900), "cars.link", old, "no_link"
    if rng.random() < 0.1:
        yield 50, "cars.crossing", "no_crossing", f"x{crossing}"
        yield 50, "cars.crossing", f"x{crossing}", "no_crossing"
    yield rng.randrange(500, 9_000), "cars.crossing", "no_crossing", f"x{crossing}"
    yield rng.randrange(1, 900), "cars.crossing", f"x{crossing}", "no_crossing"
    yield 1, "cars.link", "no_link", new
