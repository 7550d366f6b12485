"""Configuration of every kind of declaration: one a member, newcomers included (3.3.3), also of the members of a federation."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.agents.config import PlatformConfig
from dyknow.compunits import catalogue
from dyknow.kpl import parse_specification, print_specification
from dyknow.model.errors import TextErrors
from dyknow.sim_uavs.world.world import World
from tests.agents.specification.test_specification_part import EXAMPLES, Pair, text_of
from tests.kpl.instances import Running

CARS = (
    "source object cars\nsource number gps\nstrmgen ids = cars\n"
    "strmgen pos[car1] = gps\nstrmgen pos[car2] = gps\nstrmgen pos[car3] = gps\n"
)
FAMILIES = "for c in ids stream at = pos[c]\nfor c in ids monitor slow = always pos[c] < 5 with sample every 10\n"
SETS = st.sets(st.sampled_from(["car1", "car2", "car3"]))


@given(st.lists(SETS | st.integers(0, 9), max_size=20))
def test_streams_and_monitors_come_and_go_with_the_members(steps):
    run, members, wanted = Running(CARS + FAMILIES), set(), []
    nothing = Running(CARS).state().keys()
    for step in steps:
        if isinstance(step, set):
            run.push("cars", tuple(sorted(step)))
            members = step
        else:
            run.push("gps", step)
            wanted += [(f"at-{car}", step) for car in members]
        assert set(run.instance.streams) == {f"at-{car}" for car in members}
        assert set(run.instance.monitors) == {f"slow-{car}" for car in members}
    assert sorted((name, sample.value) for name, sample in run.outputs) == sorted(wanted)
    run.remove(FAMILIES)
    assert not run.instance.streams
    assert not run.instance.monitors
    assert run.state().keys() == nothing


def test_nothing_is_declared_for_those_that_are_left_out():
    family = "for c in ids - {car2, self} stream at = pos[c] with any change\n"
    assert print_specification(parse_specification(family)) == family
    run = Running(f"{CARS}{family}")
    run.push("cars", ("car1", "car2", "7", "car3"))
    assert set(run.instance.streams) == {"at-car1", "at-car3"}
    run.remove(family)
    assert not run.instance.streams


def test_the_monitor_of_a_member_raises_its_own_alarms_and_leaves_with_them():
    run = Running(CARS + FAMILIES)
    run.push("cars", ("car2",))
    for value in (1, 9, 9, 1):
        run.push("gps", value)
    assert [event.monitor for event in run.alarms[:1]] == ["slow-car2"]
    assert {event.monitor for event in run.alarms} == {"slow-car2"}


def test_what_is_declared_by_itself_takes_the_place_of_what_a_member_has_and_gives_it_back():
    run = Running(CARS + FAMILIES)
    run.push("cars", ("car1",))
    run.add("stream at-car1 = pos[car2] with any change\n")
    assert str(run.instance.streams["at-car1"].policy) == "any change"
    run.push("gps", 1)
    assert run.values("at-car1") == [1]
    run.push("cars", ("car1", "car2"))
    run.remove("stream at-car1 = pos[car2] with any change\n")
    assert str(run.instance.streams["at-car1"].policy) == "any update"
    run.push("cars", ())
    assert not run.instance.streams


def test_a_family_changes_with_its_text_and_with_definitions():
    run = Running(f"{CARS}define LIMIT = 5\n{FAMILIES.replace('< 5', '< LIMIT')}")
    run.push("cars", ("car1",))
    before = run.instance.monitors["slow-car1"]
    run.change(f"{CARS}define LIMIT = 7\n{FAMILIES.replace('< 5', '< LIMIT')}")
    assert run.instance.monitors["slow-car1"] is not before
    for value in (6, 6, 8):
        run.push("gps", value)
    assert len(run.alarms) == 1


@pytest.mark.parametrize(
    ("family", "said"),
    [
        ("for c in ids stream at = pos[car1]", "would all have the same"),
        ("for c in ids monitor m = always pos[car1] < 1", "would all have the same"),
        ("for c in ids monitor m = always fuel[c] < 1 and d = 3", "d"),
        ("for c in ids stream at = fuel[c]", "nothing makes fuel[c]"),
        ("for c in pos stream at = pos[c]", "nothing makes pos"),
        ("for c in ids stream at = pos[c]\nfor d in ids stream at = pos[d]", "at is a stream already"),
    ],
)
def test_what_is_wrong_with_a_family_is_told_with_its_line(family, said):
    with pytest.raises(TextErrors) as refused:
        Running(CARS).add(family)
    assert any(said in each.message for each in refused.value.errors)


@pytest.mark.parametrize(
    "text",
    [
        "for c in ids stream at = pos[c] with any change\n",
        "for c in ids monitor slow = always (pos[c] < 5 or c = car1) with close after 3\n",
        "for u in units import heli-altitude from u as alt[u] with sample every 1000\n",
        "for c in ids export heli-altitude = alt[c] to 1\n",
    ],
)
def test_a_family_is_read_back_as_it_is_printed(text):
    specification = parse_specification(text)
    assert print_specification(specification) == text
    assert parse_specification(print_specification(specification)) == specification


def altitudes(world, unit):
    told = [each for each in world.nodes[unit].results if each["event"] == "sample"]
    return {each["stream"] for each in told if each["valid_us"] > world.now_us - 2_000_000}


def test_for_each_unit_of_the_federation_its_streams_are_imported_while_it_is_there():
    families = (
        "for u in units import heli-altitude from u as alt[u]\nfor u in units stream high = alt[u]\n"
        "for u in units monitor low = always alt.altitude_m[u] > 125 with sample every 100, close after 1\nstream who = units\n"
    )
    pair = Pair(families, text_of("uav1.kpl"))
    assert pair.notes("0") == []
    world: World = pair.world
    world.run_for(4)
    assert altitudes(world, "0") == {"high-1"}
    world.add("2", PlatformConfig("2", 0, catalogue=catalogue([str(EXAMPLES / "flights.py")]).offered))
    pair.specify("2", text_of("uav1.kpl"))
    world.run_for(4)
    assert altitudes(world, "0") == {"high-1", "high-2"}
    assert {each["monitor"] for each in pair.told("0", "alarm-opened")} == {"low-1", "low-2"}
    world.leave("1")
    world.run_for(6)
    assert altitudes(world, "0") == {"high-2"}
    assert set(pair.declared("0").instance.streams) == {"high-0", "high-2", "who"}
    members = [each["value"] for each in pair.told("0", "sample") if each["stream"] == "who"]
    assert [set(each) for each in (members[0], members[-1])] == [{"0", "1"}, {"0", "2"}]
