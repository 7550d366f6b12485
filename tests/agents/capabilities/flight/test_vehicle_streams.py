"""What a vehicle reports, as streams: also what does not hang on its position, and what is noted of it."""

import pytest

from dyknow import Label, Network, Policy, Sample
from dyknow.agents.capabilities.flight.vehicle_streams import VehicleStreams
from dyknow.agents.config import PlatformConfig
from dyknow.agents.effects import Reported
from dyknow.agents.platform import Platform
from dyknow.federation.sharing.ontology import default_ontology
from dyknow.federation.sharing.translation import Translation
from dyknow.navigation.vehicle import BatteryReport, HomeReport, WinchReport
from tests.navigation.flights import START_US, position_at, straight

PERIOD_US = 100_000


class Streams:
    """The streams of one vehicle, their samples by label, and the notes."""

    def __init__(self) -> None:
        self.network, self.notes, self.samples = Network(), [], {"battery": [], "heli-home": [], "heli-height": []}
        translation = Translation(default_ontology())
        self.streams = VehicleStreams("0", self.network, translation, PERIOD_US, self.notes.append)
        for label, found in self.samples.items():
            self.network.connect(translation.local_label(label, "0"), Policy(), found.append)

    def take(self, *reports) -> None:
        for report, now_us in reports:
            while (due_us := self.streams.deadline_us) is not None and due_us < now_us:
                self.streams.on_time(due_us)
            self.streams.on_report(report, now_us)


@pytest.fixture
def vehicle() -> Streams:
    return Streams()


def test_battery_and_home_come_without_a_position(vehicle: Streams) -> None:
    for second in range(3):
        at_us = START_US + second * 1_000_000 + 30_000
        vehicle.take((BatteryReport(at_us, 0.9 - second / 10), at_us + 5_000))
    vehicle.take((HomeReport(START_US + 4_000_000, 47.0, 8.0, 500.0), START_US + 4_000_000))
    battery = vehicle.samples["battery"]
    assert [sample.value[0] for sample in battery][:3] == pytest.approx([0.9, 0.8, 0.7])
    assert all(sample.valid_us % PERIOD_US == 0 and sample.valid_us <= sample.available_us for sample in battery)
    assert [sample.value for sample in vehicle.samples["heli-home"]] == [(47.0, 8.0, 500.0)]
    assert vehicle.samples["heli-height"] == []


def test_with_positions_they_come_on_the_same_grid_and_never_twice(vehicle: Streams) -> None:
    at_us = START_US + 30_000
    vehicle.take((HomeReport(at_us, 47.0, 8.0, 500.0), at_us), (BatteryReport(at_us, 0.5), at_us), *straight(3))
    assert len(vehicle.samples["heli-height"]) > 20
    for found in vehicle.samples.values():
        valid_us = [sample.valid_us for sample in found]
        assert valid_us == sorted(set(valid_us))
        assert all(each % PERIOD_US == 0 for each in valid_us)


def test_a_position_that_comes_and_goes_is_noted_a_few_times_and_then_counted(vehicle: Streams) -> None:
    for second in range(0, 120, 2):
        at_us = START_US + second * 1_000_000
        times = (at_us + k * PERIOD_US for k in range(3))
        vehicle.take(*((position_at(each_us, (0.0, 0.0, -20.0)), each_us) for each_us in times))
    assert vehicle.notes[:2] == ["position ok", "position stale: silent"]
    assert 4 < len(vehicle.notes) <= 4 + 12 + 1, "60 losses in two minutes"
    assert "changes before it were not noted" in vehicle.notes[-1]


def test_a_winch_is_offered_once_it_has_reported_a_load_and_is_a_stream_from_then_on() -> None:
    platform = Platform(PlatformConfig("0", 1), START_US)
    platform.start(START_US)
    loads: list[Sample] = []
    label, ports = Label.parse("winch-load[0]"), platform.ports
    reports = [
        WinchReport(START_US + 200_000 * at, 2.0, 0.0, load, True, False) for at, load in enumerate((None, 0.0, 1.5))
    ]
    offered = []
    for at, report in enumerate((*reports, reports[-1])):
        platform.on_event(Reported(START_US + 200_000 * at, report), START_US + 200_000 * at)
        offered.append("winch-load" in {each.label for each in ports.labels()})
        if offered[-1] and not loads:
            ports.network.connect(label, Policy(), loads.append)
    assert offered == [False, True, True, True]
    assert loads[-1].value == (1.5, 2.0)
    assert len({sample.valid_us for sample in loads}) == len(loads)
