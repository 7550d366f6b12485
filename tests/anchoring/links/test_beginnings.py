"""What objects were before they were established."""

from dyknow.anchoring.links.beginnings import ObjectBeginnings
from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.links.structures import ObjectLinkage, Percept, StateRecord
from dyknow.anchoring.ready import ON_ROAD, VISION, WORLD, ready_specification
from dyknow.anchoring.roads.files.formats import read_roads
from dyknow.anchoring.roads.network import RoadNetwork
from tests.docs.pages import ROOT

TOWN = read_roads((ROOT / "examples" / "roads" / "town.geojson").read_bytes())


def linked(*seen: tuple[str, int, int, float], roads: RoadNetwork | None = None) -> list[StateRecord]:
    """The states of objects as they are reported, of one percept that moves at 10 m/s and is seen every 100 ms."""
    specifications = ready_specification(roads)
    linkage = ObjectLinkage(specifications)
    beginnings, told = ObjectBeginnings(linkage, specifications), list[StateRecord]()
    times = sorted({t for _, first, last, _ in seen for t in range(first, last + 1, 100)})
    for t in times:
        percepts = [
            Percept(name, VISION, ObjectState(t * 1000, x_m + t / 100, -1.8, 10.0, 0.0, diagonal(0.5, 1.0)))
            for name, first, last, x_m in seen
            if first <= t <= last
        ]
        told += beginnings.completed(percepts, linkage.on_percepts(t * 1000, percepts)).states
    return told


def times(told: list[StateRecord], symbol: str) -> list[int]:
    return [each.valid_us // 1000 for each in told if each.symbol == symbol]


def test_an_object_has_states_since_its_percept_was_seen_once_it_is_established_and_one_a_time() -> None:
    told = linked(("vp1", 0, 2000, 0.0))
    assert times(told, "wo1") == list(range(0, 2001, 100))
    first = next(each for each in told if each.symbol == "wo1")
    assert (first.type, first.linked_to, first.prediction) == (WORLD, ("vp1",), None)
    assert all(abs(each.state.x_m - each.valid_us / 1e5) < 1.0 for each in told)


def test_a_percept_that_ends_before_its_second_leaves_no_state_and_lends_none_to_the_next_of_its_name() -> None:
    assert linked(("c1", 0, 900, 0.0)) == []
    told = linked(("other", 0, 4000, 500.0), ("c1", 0, 800, 0.0), ("c1", 2000, 3500, 0.0))
    assert [t for t in times(told, "wo2") if t <= 3500] == list(range(2000, 3501, 100))


def test_what_is_found_again_has_no_earlier_states() -> None:
    told = linked(("vp1", 0, 2000, 0.0), ("vp2", 3000, 5000, 0.0), ("other", 0, 5000, 500.0))
    assert times(told, "wo1") == list(range(0, 5001, 100))


def test_objects_on_roads_have_the_states_of_those_below_from_the_beginning() -> None:
    told = linked(("vp1", 0, 4000, -100.0), roads=TOWN)
    assert times(told, "oo1") == list(range(0, 4001, 100))
    assert {each.linked_to for each in told if each.type == ON_ROAD} == {("wo1",)}
    assert {each.state.y_m for each in told if each.type == ON_ROAD} == {-2.0}


def test_what_is_never_linked_is_not_remembered_for_ever() -> None:
    specifications = ready_specification()
    linkage = ObjectLinkage(specifications)
    beginnings = ObjectBeginnings(linkage, specifications)
    for number in range(2000):
        state = ObjectState(number * 100_000, 1000.0 * number, 0.0, 0.0, 0.0, diagonal(0.5))
        percepts = [Percept(f"c{number}", VISION, state)]
        beginnings.completed(percepts, linkage.on_percepts(state.valid_us, percepts))
    assert len(beginnings._known) <= 610
