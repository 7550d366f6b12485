"""Whether a vehicle flies what it has published: drawn flights with and without something that carries it off."""

from random import Random

import pytest

from dyknow.agents.capabilities.separation.own.conformance import LOOKS, Conformance
from dyknow.navigation.intents.intent import IntendedPlace, Intent, IntentEnding, IntentSource, RightOfWay
from dyknow.navigation.intents.path import FlatOrigin, nominal
from dyknow.reasoning import NONCONFORMING, AlarmEvent

ORIGIN = FlatOrigin.at(58.0, 15.0)
HALF_US = 500_000


class Flight:
    """A vehicle that flies east along its leg, as its own tube has it, and is off that by as much as is given."""

    def __init__(self, source: IntentSource = IntentSource.ORDER, speed_m_s: float = 8.0) -> None:
        self.events: list[AlarmEvent] = []
        self.notes: list[str] = []
        self.conformance = Conformance("1", self.events.append, self.notes.append)
        leg = IntendedPlace(*ORIGIN.degrees(0.0, 400.0), 60.0)
        self.first = Intent(
            0, 58.0, 15.0, 60.0, 0.0, 0.0, 0.0, source, RightOfWay.NAMED, (leg,), speed_m_s=speed_m_s
        )  # fmt: skip
        self.tube = nominal(self.first, ORIGIN, 120)
        self.at = 0

    def fly(self, looks: int, north_m: float = 0.0, east_m: float = 0.0, up_m: float = 0.0) -> Intent:
        """Those looks, off by as much; returns what was published last."""
        for _ in range(looks):
            here, there = self.tube[:, self.at], self.tube[:, self.at + 1]
            latitude_deg, longitude_deg = ORIGIN.degrees(float(here[0]) + north_m, float(here[1]) + east_m)
            north_m_s, east_m_s = ((there[:2] - here[:2]) * 2.0).tolist()
            published = self.conformance.shown(
                self.first._replace(
                    at_us=self.at * HALF_US, latitude_deg=latitude_deg, longitude_deg=longitude_deg,
                    altitude_m=60.0 + up_m, north_m_s=north_m_s, east_m_s=east_m_s,
                )
            )  # fmt: skip
            self.at += 1
        return published


@pytest.mark.parametrize("seed", range(20))
def test_one_that_flies_its_way_with_gusts_and_noise_conforms(seed: int) -> None:
    random = Random(f"conforms {seed}")
    flight = Flight(speed_m_s=random.uniform(1.0, 15.0))
    for _ in range(60):
        flight.fly(1, random.uniform(-2.0, 2.0), random.uniform(-2.0, 2.0), random.uniform(-1.0, 1.0))
    assert flight.events == []


@pytest.mark.parametrize("seed", range(20))
def test_one_that_is_carried_off_is_reported_once_and_says_only_its_motion_until_it_flies_its_way_again(
    seed: int,
) -> None:
    random = Random(f"strays {seed}")
    flight = Flight(speed_m_s=random.uniform(2.0, 8.0))
    flight.fly(8)
    drift_m = random.uniform(16.0, 30.0) * random.choice((1.0, -1.0))
    published = flight.first
    for look in range(LOOKS + 2):
        published = flight.fly(1, north_m=drift_m * (look + 1))
    (opened,) = flight.events
    assert (opened.event, opened.monitor, opened.units) == ("opened", NONCONFORMING, ("1",))
    assert (published.legs, published.ending, published.contingency) == ((), IntentEnding.OPEN, None)
    assert "does not fly as it has published" in flight.notes[-1]
    published = flight.fly(30, north_m=drift_m * (LOOKS + 2))
    assert [event.event for event in flight.events] == ["opened", "closed"]
    assert published.legs == flight.first.legs


def test_one_that_sinks_where_it_is_to_fly_level_is_off_its_intent() -> None:
    flight = Flight()
    flight.fly(8)
    for look in range(LOOKS + 6):
        flight.fly(1, up_m=-1.5 * (look + 1))
    assert [event.event for event in flight.events] == ["opened"]
    assert "higher or lower" in flight.events[0].values["off"]


@pytest.mark.parametrize(
    "source", [IntentSource.MISSION, IntentSource.RETURN, IntentSource.LANDING, IntentSource.PILOT]
)
def test_what_only_its_autopilot_knows_is_not_compared(source: IntentSource) -> None:
    flight = Flight(source)
    flight.fly(8)
    for look in range(20):
        flight.fly(1, north_m=20.0 * look)
    assert flight.events == []
