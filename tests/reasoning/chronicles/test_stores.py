"""Events that are remembered: keys by a part of their values."""

from dyknow.reasoning.chronicles.recognition.stores import Store


def test_an_index_of_the_same_places_is_kept_once_and_follows_what_is_remembered() -> None:
    store = Store(plural=False)
    cars, roads = store.index([0]), store.index([1])
    assert store.index([0]) is cars
    assert roads is not cars
    assert store.insert(("car1", "road2"), 5, ("car1", "road2")) == 2
    assert store.insert(("car1", "road3"), 6, ("car1", "road3")) == 2
    assert {car: list(keys) for car, keys in cars.items()} == {"car1": [("car1", "road2"), ("car1", "road3")]}
    store.drop(("car1", "road2"), 5)
    assert list(roads) == ["road3"]
    store.keep(("car1", "road3"), [False])
    assert not cars
    assert not roads
