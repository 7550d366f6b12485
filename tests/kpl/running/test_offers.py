"""What a specification is made from comes and goes while it runs."""

from collections.abc import Iterator

import pytest

from dyknow import Label, Network, Reading, Sample, SourcePrototype, UnitPrototype, of_values
from dyknow.kpl import Hooks, Instance, parse_specification
from dyknow.model.errors import SortError

CAMERA = Label("cam")


class Told:
    def __init__(self) -> None:
        self.links: list[bool] = []
        self.samples: list[Sample] = []
        self.hooks = Hooks(
            lambda _name, sample: self.samples.append(sample), lambda _name, linked: self.links.append(linked)
        )


def every_ms(from_us: int) -> Iterator[Reading]:
    while True:
        from_us += 1000
        yield from_us, from_us


def running(text: str) -> tuple[Instance, Told]:
    told = Told()
    instance = Instance(Network(), hooks=told.hooks)
    instance.change(parse_specification(text), 0, text)
    return instance, told


def test_a_source_that_was_fed_from_outside_is_read_once_somebody_offers_it_and_nobody_is_disturbed() -> None:
    instance, told = running("source time camera\nstrmgen cam = camera\nstream seen = cam\n")
    instance.push("camera", Sample(10, 10, 10))
    instance.offer([SourcePrototype("camera", "time", every_ms)], 100)
    while instance.network.deadline_us <= 2100:
        instance.network.on_time(2100)
    assert [sample.valid_us for sample in told.samples] == [10, 1100, 2100]
    assert told.links == [True]


def test_a_source_that_is_withdrawn_ends_its_clients_are_told_and_served_again() -> None:
    text = "source time camera\nstrmgen cam = camera\nstream seen = cam\n"
    instance, told = running(text)
    offered = SourcePrototype("camera", "time", every_ms)
    instance.offer([offered], 0)
    instance.network.on_time(1000)
    instance.withdraw(["camera"], 1500)
    assert not instance.network.has(CAMERA)
    assert instance.lacking == {"camera": (CAMERA,)}
    instance.offer([offered], 5000)
    instance.network.on_time(6000)
    assert told.links == [True, False, True]
    assert [sample.valid_us for sample in told.samples] == [1000, 6000]


@pytest.mark.parametrize("text", ["compunit speed f(pos)", "source speed f"])
def test_what_does_not_fit_its_declaration_is_not_taken(text: str) -> None:
    instance, _told = running(f"source pos gps\n{text}\nstrmgen p = gps\n")
    offered = UnitPrototype("f", "speed", ("height",), lambda: of_values(lambda value: value))
    with pytest.raises(SortError, match="declared as"):
        instance.offer([offered], 0)
    assert instance.prototypes.find("f") is None


def test_a_source_without_valid_times_is_for_hosts() -> None:
    instance, told = running("source time camera\nstrmgen cam = camera\nstream seen = cam\n")
    faults: list[str] = []
    instance.network.on_fault = lambda _label, said: faults.append(said)
    instance.offer([SourcePrototype("camera", "time", lambda _from_us: iter([(None, 1)]))], 0)
    assert not told.samples
    assert "hosts" in faults[0]
