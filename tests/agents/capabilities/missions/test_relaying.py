"""A platform without a vehicle delegates a mission on, whole, with the chain shown."""

from tests.agents.capabilities.missions.flown import TWO, Flown, told


def with_post(count: int) -> Flown:
    flown = Flown(count)
    flown.world.add("post")
    flown.world.run_for(2.0)
    return flown


def test_a_command_post_has_a_platform_with_a_vehicle_lead_and_reports_what_that_reports() -> None:
    flown = with_post(2)
    dialogue = flown.begin(TWO, to="post")
    flown.until(dialogue, "started: ")
    entry = flown.entry("0")
    assert entry.chain == ("cc", "post")
    flown.until(dialogue)
    lines = told(dialogue)
    assert lines[:2] == ["agree", "leads: platform 0"], lines
    assert any(each.startswith("ended: land(uav1)") for each in lines)
    assert lines[-1].startswith("inform: reached"), lines
    assert flown.stands(0) and flown.stands(1)


def test_what_is_cancelled_at_the_post_ends_where_it_is_led() -> None:
    flown = with_post(1)
    dialogue = flown.begin(to="post")
    flown.until(dialogue, "started: ")
    flown.world.cancel("cc", "post", dialogue.conversation)
    flown.world.run_for(3.0)
    entry = flown.entry("0")
    assert (entry.phase, entry.why) == ("ended", "it was cancelled")


def test_a_refusal_names_the_platform_that_refuses_and_one_that_is_not_there_is_named_at_once() -> None:
    flown = with_post(1)
    flown.begin()
    refused = flown.begin(to="post")
    flown.world.run_for(2.0)
    assert told(refused)[-1].startswith("refuse: platform 0: this platform has mission m1 already"), told(refused)
    absent = flown.begin(to="post", mission="m2", platforms={"uav0": "9"})
    assert told(absent) == ["refuse: none of the platforms 9 is there to lead the mission"], told(absent)
    wrong = flown.begin(to="post", mission="m3", problem="#objects uav = {")
    assert told(wrong)[0].startswith("refuse") or told(wrong)[0].startswith("not-understood"), told(wrong)
