"""Objects in a stream: who is there at each time, and what of each is a stream (Def. 8.5.1)."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from dyknow import Field, Label, Network, Policy, Sort
from dyknow.model.members import MAX_MEMBERS
from dyknow.model.sample import Sample
from dyknow.objects.object_streams import ObjectStreams
from dyknow.objects.object_table import SILENCE_US

CAR = Sort("car", (Field("symbol", "text"), Field("x_m", "m"), Field("colour", "text"), Field("end", "bool")))
CARS = Label("cars")
SECOND = 1_000_000


class Seen:
    """A network with the stream `cars`, and what its streams brought."""

    def __init__(self, sort: Sort = CAR) -> None:
        self.network = Network()
        self.faults: list[str] = []
        self.network.on_fault = lambda _label, said: self.faults.append(said)
        self.objects = ObjectStreams(self.network)
        self.network.resolve = self.objects.find
        self.network.add_source(CARS, sort, 100)

    def follow(self, label: str) -> list[Sample]:
        brought: list[Sample] = []
        self.network.connect(label, Policy(), brought.append, current=True)
        return brought

    def see(self, symbol: str, at_us: int, x_m: float = 0.0, colour: str = "red", *, end: bool = False) -> None:
        self.network.on_time(at_us)
        self.network.push(CARS, Sample(at_us, at_us, (symbol, x_m, colour, end)))


steps = st.lists(st.tuples(st.sampled_from("abc"), st.integers(0, 40), st.booleans()), max_size=30)


@given(steps)
def test_who_is_there_is_who_has_had_a_state_within_a_minute_and_none_that_ended(
    drawn: list[tuple[str, int, bool]],
) -> None:
    seen, now_us = Seen(), 0
    brought = seen.follow("cars.objects")
    last: dict[str, int] = {}
    for symbol, later_s, end in drawn:
        now_us += later_s * SECOND + 1
        seen.see(symbol, now_us, end=end)
        last.pop(symbol, None)
        last.update({} if end else {symbol: now_us})
        last = {name: at_us for name, at_us in last.items() if at_us + SILENCE_US > now_us}
        assert set(brought[-1].value) == set(last)
    valid = [sample.valid_us for sample in brought]
    assert valid == sorted(valid)
    assert all(set(one.value) != set(other.value) for one, other in pairwise(brought))


def test_an_object_appears_with_its_first_state_and_vanishes_a_minute_after_its_last() -> None:
    seen = Seen()
    brought = seen.follow("cars.objects")
    seen.see("car1", 5 * SECOND)
    seen.see("car1", 7 * SECOND)
    seen.network.on_time(80 * SECOND)
    assert [(each.valid_us, each.value) for each in brought] == [
        (0, ()),
        (5 * SECOND, ("car1",)),
        (7 * SECOND + SILENCE_US, ()),
    ]


def test_what_comes_in_one_instant_is_told_in_one_sample() -> None:
    seen = Seen()
    brought = seen.follow("cars.objects")
    with seen.network.instant.whole():
        for name in ("car1", "car2", "car3"):
            seen.see(name, SECOND)
    assert [each.value for each in brought] == [(), ("car1", "car2", "car3")]


def test_of_one_object_there_is_its_state_each_attribute_and_its_type() -> None:
    seen = Seen()
    labels = ("cars[car1]", "cars.x_m[car1]", "colour[car1]", "type[car1]")
    brought = {label: seen.follow(label) for label in labels}
    seen.see("car1", SECOND, 2.0, "blue")
    seen.see("car2", SECOND, 3.0, "red")
    assert {label: [each.value for each in found] for label, found in brought.items()} == {
        "cars[car1]": [("car1", 2.0, "blue", False)],
        "cars.x_m[car1]": [2.0],
        "colour[car1]": ["blue"],
        "type[car1]": ["car"],
    }


def test_who_comes_late_has_the_newest_state_at_once() -> None:
    seen = Seen()
    seen.see("car1", SECOND, 2.0)
    seen.see("car1", 2 * SECOND, 3.0)
    assert [(each.valid_us, each.value) for each in seen.follow("cars.x_m[car1]")] == [(2 * SECOND, 3.0)]
    assert [each.value for each in seen.follow("cars.objects")] == [("car1",)]


def test_a_domain_that_is_asked_for_before_its_stream_is_there_begins_with_it() -> None:
    seen = Seen()
    brought, colours = seen.follow("trucks.objects"), seen.follow("length_m[t1]")
    seen.network.add_source(Label("trucks"), Sort("truck", (Field("symbol", "text"), Field("length_m", "m"))))
    seen.network.push("trucks", Sample(SECOND, SECOND, ("t1", 9.0)))
    assert [each.value for each in brought] == [(), ("t1",)]
    assert [each.value for each in colours] == [9.0]


def test_without_a_producer_nobody_is_there() -> None:
    seen = Seen()
    brought = seen.follow("cars.objects")
    seen.see("car1", SECOND)
    seen.network.remove(CARS)
    assert brought[-1].value == ()
    seen.network.add_source(CARS, CAR)
    seen.see("car2", 2 * SECOND)
    assert brought[-1].value == ("car2",)


def test_what_is_no_symbol_and_what_is_too_many_is_left_out_and_told_once() -> None:
    seen = Seen()
    brought = seen.follow("cars.objects")
    with seen.network.instant.whole():
        for i in range(MAX_MEMBERS + 50):
            seen.see(f"car{i}", SECOND)
    seen.see("no symbol", SECOND)
    seen.see("*", SECOND)
    assert len(brought[-1].value) == MAX_MEMBERS
    assert len(seen.faults) == 1
    seen.see("car1", 2 * SECOND, end=True)
    seen.see("x y", 2 * SECOND)
    seen.see("late", 2 * SECOND)
    assert "late" in brought[-1].value
    assert len(seen.faults) == 2


def test_nothing_stays_of_objects_that_come_and_go_nor_of_who_followed_them() -> None:
    seen = Seen()
    domain = seen.network.connect("cars.objects", Policy(), lambda _sample: None)
    for i in range(300):
        one = seen.network.connect(f"cars.x_m[car{i}]", Policy(), lambda _sample: None)
        seen.see(f"car{i}", i * SECOND, 1.0)
        seen.see(f"car{i}", i * SECOND + 1, 1.0, end=True)
        one.cancel()
    assert seen.network.labels() == (CARS, Label("cars.objects"))
    table = seen.objects.table(CARS)
    assert table is not None
    assert (table.newest, table._on_state) == ({}, {})
    domain.cancel()
    assert seen.network.labels() == (CARS,)
    assert not seen.network.generator(CARS).subscriptions
    assert seen.network.deadline_us is None
