"""Aircraft that are no members: heard, shown, warned of."""

from math import hypot
from pathlib import Path
from random import Random

import pytest

from dyknow.agents.capabilities.traffic.records import traffic_value
from dyknow.agents.capabilities.traffic.traffic import Traffic
from dyknow.agents.effects import Fed, Specify
from dyknow.federation.messages.contents import MonitorProximity
from dyknow.navigation.traffic import moved
from tests.agents.capabilities.traffic.heard import Straight, alarms, hear, listen
from tests.box import Box, Vehicle

HELICOPTER = Straight()


def box_of_two(**vehicle: float) -> Box:
    box = Box(seed=1)
    box.join("0", Vehicle(**vehicle))
    box.join("1", Vehicle(north_m=300.0))
    box.run(3.0)
    return box


def test_a_helicopter_is_warned_of_a_minute_before_well_clear_is_lost():
    box = box_of_two()
    begun_us = box.clock.federation_us(box.now_us)
    listen(box, "0", 100.0, HELICOPTER, begun_us=begun_us)
    lost_us = begun_us + round((8000.0 - 609.6) / 60.0 * 1e6)
    for unit in ("0", "1"):
        first = alarms(box, unit)[0]
        assert first.event == "opened"
        assert first.units == (unit, HELICOPTER.identity)
        assert lost_us - first.detected_us >= 60_000_000
    time_s = alarms(box, "0")[0].values[f"time_to_violation[0, {HELICOPTER.identity}]"] / 1e6
    assert abs(alarms(box, "0")[0].valid_us + time_s * 1e6 - lost_us) <= 300_000
    told = box.platform("0").part(Traffic).aircraft(box.clock.federation_us(box.now_us))
    assert [one.identity for one in told] == [HELICOPTER.identity]


def test_an_aircraft_that_falls_silent_ends_its_alarm_after_15_s():
    box = box_of_two()
    begun_us = box.clock.federation_us(box.now_us)
    listen(box, "0", 60.0, HELICOPTER, begun_us=begun_us)
    assert [each.event for each in alarms(box, "0")] == ["opened"]
    box.run(17.5)
    assert [each.event for each in alarms(box, "0")] == ["opened", "ended"]
    assert not box.platform("0").part(Traffic).aircraft(box.clock.federation_us(box.now_us))


def traffic(box: Box, unit: str) -> list[str]:
    return [each.identity for each in box.platform(unit).part(Traffic).aircraft(box.clock.federation_us(box.now_us))]


@pytest.mark.parametrize("seed", [*range(4), *(pytest.param(seed, marks=pytest.mark.full) for seed in range(4, 60))])
def test_of_drawn_lines_those_that_lose_well_clear_are_warned_of_in_time_and_no_far_one_is(seed: int):
    draw = Random(seed)
    box = box_of_two()
    begun_us = box.clock.federation_us(box.now_us)
    speed_m_s, miss_m = (
        draw.uniform(8.0, 120.0),
        draw.choice((draw.uniform(-550.0, 550.0), draw.uniform(1500.0, 3000.0))),
    )
    climb_m_s, away_s = draw.choice((0.0, draw.uniform(-0.3, 0.3))), 100.0 + 700.0 / speed_m_s
    one = Straight(
        north_m=miss_m, east_m=speed_m_s * away_s, altitude_m=100.0 - climb_m_s * away_s, east_m_s=-speed_m_s,
        up_m_s=climb_m_s,
    )  # fmt: skip
    lost_s = next((s / 10 for s in range(2000) if _lost(one, s / 10)), None)
    listen(box, "0", away_s, one, begun_us=begun_us)
    told = alarms(box, "0")
    if lost_s is None:
        assert told == []
    else:
        ahead_s = lost_s - (told[0].detected_us - begun_us) / 1e6
        assert 60.0 <= ahead_s <= 90.0


def _lost(one: Straight, at_s: float) -> bool:
    """Whether well clear of the vehicle, which hovers at 100 m, is lost."""
    apart_m = hypot(one.north_m + one.north_m_s * at_s, one.east_m + one.east_m_s * at_s)
    return apart_m < 609.6 and abs(one.altitude_m + one.up_m_s * at_s - 100.0) < 76.2


def test_what_broadcasts_at_the_place_of_a_member_that_flies_is_its_own_echo_until_it_leaves():
    box = box_of_two(north_m_s=8.0)
    begun_us = box.clock.federation_us(box.now_us)
    # The vehicle of 0 began 3 s before.
    echo = Straight("adsb-000abc", 24.0, 0.0, 100.0, 8.0, 0.0)
    listen(box, "0", 8.0, echo, begun_us=begun_us)
    assert traffic(box, "0") == []
    assert box.platform("0").part(Traffic).echoes == {"adsb-000abc": "0"}
    away = echo._replace(east_m=0.0, east_m_s=15.0)
    listen(box, "0", 12.0, away, begun_us=box.clock.federation_us(box.now_us) - 8_000_000)
    assert "adsb-000abc" in {name.removesuffix("_2") for name in traffic(box, "0")}


def test_a_foreign_drone_that_hovers_next_to_one_of_ours_is_traffic():
    box = box_of_two()
    drone = Straight("rid-xyz", 12.0, 5.0, 102.0, 0.0, 0.0, source="remote-id")
    listen(box, "0", 30.0, drone, begun_us=box.clock.federation_us(box.now_us))
    assert traffic(box, "0") == ["rid-xyz"]
    assert [each.event for each in alarms(box, "0")] == ["opened"]


def test_remote_id_under_a_member_s_name_counts_only_where_that_member_is():
    box = box_of_two()
    mine = Straight("rid-0", 0.0, 0.0, 100.0, 0.0, 0.0, source="remote-id")
    false = Straight("rid-1", 2000.0, 0.0, 100.0, 0.0, -20.0, source="remote-id")
    listen(box, "0", 6.0, mine, false, begun_us=box.clock.federation_us(box.now_us))
    assert traffic(box, "0") == ["rid-1"]


def test_a_flood_of_identities_is_counted_and_shown_and_the_near_one_is_kept():
    box = box_of_two()
    draw = Random(7)
    begun_us = box.clock.federation_us(box.now_us)
    near = Straight(east_m=3000.0)
    listen(box, "0", 4.0, near, begun_us=begun_us)
    for _ in range(20):
        at_us = box.clock.federation_us(box.now_us)
        flood = [
            Straight(f"adsb-{draw.getrandbits(24):06x}", draw.uniform(-2e4, 2e4), draw.uniform(-2e4, 2e4)).heard(at_us, at_us)
            for _ in range(500)
        ]  # fmt: skip
        broken = [one._replace(latitude_deg=float("nan")) for one in flood[:9]]
        far = [one._replace(latitude_deg=91.0) for one in flood[:9]]
        hear(box, "0", *flood, *broken, *far, near.heard(begun_us, at_us), left_out=(("too many", 10_000),))
        box.run(0.5)
        picture = box.platform("0").part(Traffic).picture
        assert len(picture) <= picture.most
        assert near.identity in traffic(box, "0")
    assert picture.counts["no number"] == picture.counts["no place"] == 180
    told = [each.text for each in box.platform("0").part(Traffic).conditions()]
    assert any("too many" in text for text in told)
    listen(box, "0", 1.0, near, begun_us=begun_us)
    assert alarms(box, "0")


def test_an_identity_in_two_places_is_two_aircraft_so_that_neither_hides_the_other():
    box = box_of_two()
    begun_us = box.clock.federation_us(box.now_us)
    real = Straight(east_m=4000.0)
    false = real._replace(north_m=60_000.0)
    for _ in range(20):
        at_us = box.clock.federation_us(box.now_us)
        hear(box, "0", real.heard(begun_us, at_us), false.heard(begun_us, at_us))
        box.run(1.0)
    assert sorted(traffic(box, "0")) == ["adsb-4ca123", "adsb-4ca123_2"]
    assert alarms(box, "0")


def test_a_profile_about_aircraft_is_no_task():
    box = box_of_two()
    box.centre()
    box.run(1.0)
    asked = box.asked("cc", "0", MonitorProximity(profile="traffic-well-clear"))
    box.run(1.0)
    assert asked.contents[-1].code == "no-task"


EXAMPLES = Path(__file__).parents[4] / "examples/aircraft"


def test_a_source_of_a_specification_feeds_the_picture_under_its_own_name():
    box = box_of_two()
    specify(box, "0", "radar.kpl")
    at_us = box.clock.federation_us(box.now_us)
    state = moved(HELICOPTER._replace(identity="track-7", source="").heard(at_us, at_us), at_us)
    box.happens("0", Fed(box.now_us, "radar", at_us, traffic_value(state)))
    box.run(2.0)
    (one,) = box.platform("0").part(Traffic).aircraft(at_us)
    assert (one.identity, one.source, one.by) == ("radar-track-7", "radar", ("0",))
    assert traffic(box, "1") == ["radar-track-7"]


def test_a_formula_over_the_aircraft_of_another_platform():
    box = box_of_two()
    begun_us = box.clock.federation_us(box.now_us)
    listen(box, "0", 2.0, HELICOPTER._replace(east_m=3000.0), begun_us=begun_us)
    specify(box, "1", "far.kpl")
    listen(box, "0", 25.0, HELICOPTER._replace(east_m=3000.0), begun_us=begun_us)
    assert [each.event for each in alarms(box, "1", "far-adsb-4ca123")][:1] == ["opened"]


def specify(box: Box, unit: str, name: str) -> None:
    box.happens(unit, Specify(box.now_us, (EXAMPLES / name).read_text(), name))
    box.run(0.5)


def test_a_member_that_lies_about_an_aircraft_hides_none_that_this_platform_hears():
    box = box_of_two()
    begun_us = box.clock.federation_us(box.now_us)
    real, part = Straight(east_m=4000.0), box.platform("0").part(Traffic)
    for step in range(20):
        at_us = box.clock.federation_us(box.now_us)
        hear(box, "0", real.heard(begun_us, at_us))
        false = real._replace(north_m=min(3000.0, 400.0 * step), east_m_s=0.0).heard(begun_us, at_us + 1_500_000)
        part.picture.take(false, "1", at_us)
        box.run(1.0)
        (first,) = [one for one in part.aircraft(at_us) if one.identity == real.identity]
        assert first.by[0] == "0"
        assert first.east_m_s == real.east_m_s
    assert any(each.units == ("0", real.identity) for each in alarms(box, "0"))
    assert f"{real.identity}-2" in traffic(box, "0")
