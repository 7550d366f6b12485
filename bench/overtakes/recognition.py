"""What is seen of cars, through the computational units of the library, to what chronicles recognise in it."""

from collections.abc import Callable, Iterator
from functools import cache
from itertools import permutations
from pathlib import Path
from typing import Any, Final

from bench.overtakes.drives import Seen
from dyknow import ComputationalUnit, Label, Sample, UnitPrototype, Value, prototypes_in
from dyknow.compunits import (
    NO_CROSSING,
    ROAD_RELATIONS,
    CarByStep,
    CarOnRoad,
    RoadRelations,
    SmoothOffset,
    StableFields,
    road_offset,
)
from dyknow.kpl import parse_chronicles
from dyknow.reasoning.chronicles import ChangeEvents, ChronicleFile, ChronicleInstance, Recogniser

CHRONICLES: Final = Path(__file__).parents[2] / "examples" / "traffic" / "overtakes.chr"
LINK: Final = "l1"
_RAW: Final = (road_offset, RoadRelations)
_FILTERED: Final = (road_offset, SmoothOffset, RoadRelations, StableFields)

Step = Callable[[int, Value], Sample | None]
"""One unit with one input: from valid time and value to its output."""


@cache
def chronicles() -> ChronicleFile:
    return parse_chronicles(CHRONICLES.read_text(encoding="utf-8"))


def recognised(seen: Seen, *, filtered: bool, names: tuple[str, ...] | None = None) -> list[ChronicleInstance]:
    """What of the chronicles with these names is recognised, by filtered relations or by raw ones."""
    recogniser = Recogniser.of(chronicles(), names)
    events = ChangeEvents(recogniser)
    attributes = {name.rpartition(".")[2] for name, _arity in recogniser.attributes}
    wanted = [(at, field.name) for at, field in enumerate(ROAD_RELATIONS.fields) if field.name in attributes]
    labels = {
        pair: [(at, Label(f"car_relations.{name}", pair)) for at, name in wanted]
        for pair in permutations(seen.places, 2)
    }
    return [
        instance
        for at_us, pair, record in relations(seen, filtered=filtered)
        for at, label in labels[pair]
        for instance in events.on_sample(label, at_us, record[at])
    ]


def relations(seen: Seen, *, filtered: bool) -> Iterator[tuple[int, tuple[str, str], tuple[bool, ...]]]:
    """Valid time (us), pair of cars, and the record of their relations, ROAD_RELATIONS."""
    cars = {car: _chain(CarOnRoad if filtered else CarByStep) for car in seen.places}
    pairs = {pair: _chain(*(_FILTERED if filtered else _RAW)) for pair in permutations(cars, 2)}
    places = {car: each.tolist() for car, each in seen.places.items()}
    for i, at_us in enumerate(seen.at_us):
        on = {car: seen.links[car][i] if car in seen.links else LINK for car in cars}
        now = {
            car: step(at_us, (car, *places[car][i], seen.road_deg, on[car], NO_CROSSING)) for car, step in cars.items()
        }
        for pair, step in pairs.items():
            first, second = now[pair[0]], now[pair[1]]
            made = None if first is None or second is None else step(at_us, (first.value, second.value))
            if made is not None and isinstance(made.value, tuple):
                yield at_us, pair, made.value


def _chain(*units: Any) -> Step:
    """Units with one input each, one behind the other."""
    made = [ComputationalUnit(unit.make(), 1) for unit in prototypes_in(units) if isinstance(unit, UnitPrototype)]

    def step(at_us: int, value: Value) -> Sample | None:
        sample: Sample | None = Sample(at_us, at_us, value)
        for unit in made:
            if sample is None:
                return None
            sample = unit.on_sample(0, sample, at_us)
        return sample

    return step
