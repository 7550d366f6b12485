"""One picture from several platforms of a federation: names, partitions, returns, questions."""

from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import ObjectEvents, ObjectPicture
from tests.agents.capabilities.cooperation.federations import SPEC, Federation, car

OVER = """compunit global-object SeenTogether(global-object)
strmgen everyone = SeenTogether(global-objects[self])
stream there = everyone.objects
"""
FIRST, SECOND = car(0.0), car(40.0, y_m=3.5)


def both(t):
    return {"0": [("co3", *FIRST(t)), ("co4", *SECOND(t))], "1": [("co7", *FIRST(t)), ("co8", *SECOND(t))]}


def test_platforms_agree_that_car_3_here_is_car_7_there():
    federation = Federation(SPEC, SPEC)
    federation.world.run_for(1)
    federation.drive(7, both)
    for one, other in (("co3", "co7"), ("co4", "co8")):
        names = {federation.name(unit, symbol, of) for unit, symbol in (("0", one), ("1", other)) for of in "01"}
        assert len(names) == 1
        assert None not in names
    assert federation.name("0", "co3") != federation.name("0", "co4")
    assert all(row.by == ("0", "1") for row in federation.rows("1").values())


def test_the_picture_is_asked_for_and_has_one_row_for_each_car():
    federation = Federation(SPEC, SPEC)
    federation.world.run_for(1)
    federation.drive(7, both)
    asked = federation.world.ask("1", "0", ObjectPicture(), Performative.QUERY_REF)
    federation.world.run_for(1)
    (picture,) = asked.results
    assert picture.members == ("0", "1")
    assert {tuple(sorted(each.tracks)) for each in picture.objects} == {("0:co3", "1:co7"), ("0:co4", "1:co8")}
    assert all(each.attributes["sd_m"] < 1.0 and each.by == ("0", "1") for each in picture.objects)


def test_without_exported_tracks_there_is_no_picture():
    federation = Federation("", "")
    federation.world.run_for(2)
    asked = federation.world.ask("1", "0", ObjectPicture(), Performative.QUERY_REF)
    federation.world.run_for(1)
    assert asked.results == [ObjectPicture(members=(), objects=())]


def test_what_happened_to_an_object_is_told_once_with_its_reason():
    federation = Federation(SPEC, SPEC)
    federation.world.run_for(1)
    federation.drive(7, both)
    name = federation.name("0", "co3")
    events = []
    for unit in "01":
        asked = federation.world.ask(
            "1" if unit == "0" else "0", unit, ObjectEvents(symbol=name), Performative.QUERY_REF
        )
        federation.world.run_for(1)
        events += asked.results[0].events
    assert sorted(each.event for each in events) == ["appeared", "joined"]
    assert any("co3 of 0 and co7 of 1: d^2 =" in each.because for each in events)


def test_a_car_of_a_platform_that_is_cut_off_is_kept_and_found_again_within_two_seconds():
    federation = Federation(SPEC, SPEC)

    def apart(t):
        return {"0": [("co3", *FIRST(t))], "1": [("co7", *car(500.0)(t))]}

    federation.world.run_for(1)
    federation.drive(7, apart)
    name = federation.name("1", "co7")
    federation.world.partition("0", "1")
    federation.drive(10, apart)
    row = federation.rows("0")[name]
    assert row.by == ()
    assert row.state.deviation_m > 10.0
    assert any("platform 1 departed" in note for note in federation.notes("0"))
    federation.world.heal("0", "1")
    while federation.world.platform("0").ports.directory.is_present("1") is False:
        federation.drive(0.1, apart)
    federation.drive(2, apart)
    assert federation.rows("0")[name].by == ("1",)
    assert federation.name("1", "co7") == name
    assert any("platform 1 arrived" in note for note in federation.notes("0"))


def test_a_platform_that_restarts_takes_over_the_names_that_others_have():
    federation = Federation(SPEC, SPEC)
    federation.world.run_for(1)
    federation.drive(7, both)
    names = federation.name("0", "co3"), federation.name("0", "co4")
    federation.world.restart("1")
    federation.specify("1", SPEC)

    def again(t):
        return {**both(t), "1": [("co1", *SECOND(t)), ("co2", *FIRST(t))]}

    federation.drive(8, again)
    assert (federation.name("0", "co3"), federation.name("0", "co4")) == names
    assert (federation.name("1", "co2"), federation.name("1", "co1")) == names


def test_the_picture_is_a_domain_of_a_specification():
    over = f"{SPEC}{OVER}"
    federation = Federation(over, SPEC)
    federation.world.run_for(1)
    federation.drive(7, both)
    there = [each["value"] for each in federation.told("0", "sample") if each["stream"] == "there"][-1]
    assert sorted(there) == sorted({federation.name("0", "co3"), federation.name("0", "co4")})


def test_a_member_that_reports_what_cannot_be_is_left_out_and_named():
    federation = Federation(SPEC, SPEC)
    federation.world.run_for(1)

    def wrong(t):
        return {"0": [("co3", *FIRST(t))], "1": [("co9", 1e8, 0.0, 1.0, 0.0)]}

    federation.drive(5, wrong)
    assert [*federation.rows("0")] == [federation.name("0", "co3")]
    assert any("of platform 1 is left out" in note for note in federation.notes("0"))
    assert federation.part("0").picture.gate.refused["1", "too far or too fast"] > 5
