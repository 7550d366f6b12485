"""The picture of a federation: what messages make of it, and how little of it is sent."""

import json
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from dyknow.console.picture.differences import Sections, difference
from dyknow.console.picture.measures import close_pairs
from dyknow.console.picture.picture import MOST_OTHERS, SECTIONS, Picture
from dyknow.console.web.feeds import RecordedFeed, RecordingViewer
from dyknow.runtime.recordings import foxglove
from dyknow.runtime.recordings import recording_file as kinds
from dyknow.runtime.recordings.recorded import FederationRecording

RECORDING = Path(__file__).parents[3] / "examples/recordings/encounter.mcap"
KINDS = [
    kinds.SAMPLE,
    kinds.PLATFORM,
    kinds.ALARM,
    kinds.MONITOR,
    kinds.TASK,
    kinds.MISSIONS,
    kinds.IMPORTS,
    kinds.FLIGHTS,
    kinds.ACT,
    kinds.LOST,
]
EVIL = "<img src=x onerror=alert(1)>\x1b]0;owned\x07\u202e"


def sample(unit: str, label: str, valid_us: int, **value: Any) -> dict[str, Any]:
    return {"unit": unit, "label": label, "valid_us": valid_us, "value": value}


def applied(before: Sections, changes: Any) -> dict[str, dict[str, Any]]:
    """As the page does it."""
    after = {name: dict(rows) for name, rows in before.items()}
    for section, rows in changes.items():
        for name, row in rows.items():
            if row is None:
                del after[section][name]
            else:
                after[section][name] = row
    return after


def test_a_platform_is_where_its_newest_sample_says_and_leaves_a_trail() -> None:
    picture = Picture()
    for second in range(3):
        us = 1_000_000 * (second + 1)
        picture.take(us, kinds.SAMPLE, sample("7", "heli-position", us, latitude_deg=58.0 + second, longitude_deg=15.0))
        picture.take(us, kinds.SAMPLE, sample("7", "heli-velocity", us, north_m_s=0.0, east_m_s=3.0, down_m_s=-1.0))
    row = picture.sections()["platforms"]["7"]
    assert (row["at"], row["course"], row["speed"], row["climb"]) == ([60.0, 15.0], 90.0, 3.0, 1.0)
    assert picture.trails() == {"7": [[58.0, 15.0], [59.0, 15.0], [60.0, 15.0]]}


def test_a_close_pair_has_its_distance_and_a_far_one_is_none() -> None:
    platforms = {
        "0": {"at": [58.0, 15.0], "altitude": 60.0},
        "1": {"at": [58.0001, 15.0], "altitude": 72.5},
        "2": {"at": [58.1, 15.0]},
    }
    [pair] = close_pairs(platforms).values()
    assert pair == {"units": ["0", "1"], "apart": 11.1, "above": 12.5}


def intent(valid_us: int, source: str = "route", legs: str = "58.002,15.0,60.0", **changes: Any) -> dict[str, Any]:
    """As a recorder writes it."""
    value = {
        "source": source, "rank": "named", "latitude_deg": 58.0 + valid_us * 1e-12, "longitude_deg": 15.0, "altitude_m": 60.0,
        "north_m_s": 5.0, "east_m_s": 0.0, "down_m_s": 0.0, "speed_m_s": 5.0, "climb_m_s": 2.5, "descent_m_s": 1.5,
        "radius_m": 2.0, "half_height_m": 1.0, "legs": legs, "ending": "hover", "failsafe": "5.0 land 58.0,15.001,60.0",
    }  # fmt: skip
    return sample("1", "intent", valid_us, **{**value, **changes})


def test_an_intent_is_drawn_with_what_is_flown_on_a_lost_link_until_the_vehicle_is_on_the_ground() -> None:
    picture = Picture()
    picture.take(1_000_000, kinds.SAMPLE, intent(1_000_000))
    row = picture.sections()["intents"]["1"]
    assert (row["legs"], row["source"], row["rank"]) == ([[58.002, 15.0, 60.0]], "route", "named")
    assert (row["after_s"], row["failsafe"], row["failsafe_ending"]) == (5.0, [[58.0, 15.001, 60.0]], "land")
    for broken in ({"legs": "58.0,north,60.0"}, {"latitude_deg": 91.0}, {"speed_m_s": float("nan")}, {"rank": EVIL}):
        picture.take(2_000_000, kinds.SAMPLE, intent(2_000_000, **broken))
        assert "1" not in picture.sections()["intents"], broken
        picture.take(3_000_000, kinds.SAMPLE, intent(3_000_000))
    picture.take(4_000_000, kinds.SAMPLE, intent(4_000_000, "ground", ""))
    assert picture.sections()["intents"] == {}


def test_an_intent_that_says_the_same_is_sent_every_two_seconds_and_a_change_at_once() -> None:
    picture, sent = Picture(), 0
    before = picture.sections()
    for half in range(41):
        us = 1_000_000 + half * 500_000
        picture.take(us, kinds.SAMPLE, intent(us))
        after = picture.sections()
        sent += "intents" in difference(before, after)
        before = after
    assert sent == 11
    picture.take(21_100_000, kinds.SAMPLE, intent(21_100_000, "manoeuvre", "58.002,15.0,84.0"))
    assert picture.sections()["intents"]["1"]["source"] == "manoeuvre"


def act(text: str, direction: str = "out") -> dict[str, Any]:
    return {"by": "1", "at_us": 5, "direction": direction, "peer": "0", "outcome": "sent", "act": text}


def test_of_a_meeting_it_is_known_which_one_yields_and_whether_that_is_agreed() -> None:
    picture = Picture()
    of = ":sender interface@{} :receiver interface@{} :conversation-id 1-7.0"
    picture.take(5, kinds.ACT, act(f"(request {of.format(1, 0)} :content (avoid units: (sequence 1 0)))"))
    [row] = picture.sections()["meetings"].values()
    assert (row["units"], row["yields"], row["to"], row["agreed"]) == (["0", "1"], "1", "0", False)
    picture.take(6, kinds.ACT, act(f"(agree {of.format(0, 1)})", "in"))
    assert picture.sections()["meetings"]["0 1"]["agreed"]
    picture.take(
        7, kinds.ACT, act(f'(request {of.format(1, 0)} :content (avoid units: (sequence 1 0) because: "mode AUTO"))')
    )
    [row] = picture.sections()["meetings"].values()
    assert (row["yields"], row["to"], row["because"]) == ("0", "1", "mode AUTO")


def test_an_alarm_opens_with_its_reasons_and_keeps_them_when_it_closes() -> None:
    picture = Picture()
    alarm = {"id": "a", "monitor": "proximity", "by": "0", "units": ["0", "1"], "values": {"xy_dist[0, 1]": 14.5}}
    picture.take(1, kinds.ALARM, {**alarm, "event": "opened", "valid_us": 1_000, "because": ["xy_dist >= 15 is false"]})
    assert picture.sections()["alarms"]["a"]["event"] == "opened"
    picture.take(2, kinds.ALARM, {**alarm, "event": "closed", "valid_us": 3_000, "values": {}})
    row = picture.sections()["alarms"]["a"]
    assert (row["event"], row["opened_us"], row["closed_us"]) == ("closed", 1_000, 3_000)
    assert row["because"] == ["xy_dist >= 15 is false"]
    assert row["values"] == {"xy_dist[0, 1]": 14.5}


def test_a_monitor_remembers_since_when_it_shows_what() -> None:
    picture = Picture()
    entry = {
        "by": "0",
        "monitor": "proximity",
        "units": ["0", "1"],
        "which": [],
        "verdict": "undecided",
        "inputs": "fresh",
    }
    for at_us, shows in ((1, "ok"), (2, "alarm"), (3, "alarm"), (4, "ok")):
        picture.take(at_us, kinds.MONITOR, {**entry, "shows": shows})
    picture.take(5, kinds.MONITOR, {**entry, "change": "unknown", "which": ["heli-position[1]"]})
    [row] = picture.sections()["monitors"].values()
    assert row["history"] == [[1, "ok"], [2, "alarm"], [4, "ok"], [5, "unknown"]]
    assert row["which"] == ["heli-position[1]"]


def test_objects_stand_where_their_metres_are_from_the_origin_and_go_when_they_end() -> None:
    picture = Picture((58.0, 15.0))
    car = {"symbol": "car1", "x_m": 0.0, "y_m": 111.4, "existence": 0.9, "end": False}
    picture.take(1, kinds.SAMPLE, sample("0", "believed-objects", 1, **car))
    [row] = picture.sections()["objects"].values()
    assert round(row["at"][0], 3) == 58.001
    picture.take(2, kinds.SAMPLE, sample("0", "believed-objects", 2, **{**car, "end": True}))
    assert not picture.sections()["objects"]


def flight(unit: str, **said: Any) -> dict[str, Any]:
    return {"by": unit, "commander": "route", "doing": "flies its route", "ahead": ["58.0 15.0", "58.1 15.1"], **said}


def test_objects_stand_where_their_platform_says_that_metres_count_from() -> None:
    picture = Picture()
    car = {"symbol": "car1", "x_m": 0.0, "y_m": 111.4, "end": False}
    picture.take(1, kinds.SAMPLE, sample("0", "object-tracks", 1, **car))
    assert next(iter(picture.sections()["objects"].values()))["at"] is None
    assert picture.base is None
    picture.take(2, kinds.FLIGHTS, flight("0", origin="58.0 15.0"))
    picture.take(3, kinds.SAMPLE, sample("0", "object-tracks", 3, **car))
    assert round(next(iter(picture.sections()["objects"].values()))["at"][0], 3) == 58.001
    assert picture.base == [58.0, 15.0]


def test_an_aircraft_that_is_no_member_stands_where_it_is_heard_and_goes_when_it_ends() -> None:
    picture = Picture()
    heard = {"symbol": "adsb-4ca123", "latitude_deg": 58.1, "longitude_deg": 15.2, "altitude_m": 130.0, "sd_m": 66.0}
    heard |= {"vx_m_s": -60.0, "vy_m_s": 0.0, "callsign": "LN-OKA", "kind": "rotocraft", "end": False}
    picture.take(1, kinds.SAMPLE, sample("0", "traffic", 1, **heard))
    (row,) = picture.sections()["objects"].values()
    shown = {key: row[key] for key in ("at", "altitude_m", "callsign", "kind", "vx_m_s")}
    assert shown == {
        "at": [58.1, 15.2], "altitude_m": 130.0, "callsign": "LN-OKA", "kind": "rotocraft", "vx_m_s": -60.0,
    }  # fmt: skip
    picture.take(2, kinds.SAMPLE, sample("0", "traffic", 2, symbol="adsb-4ca123", end=True))
    assert picture.sections()["objects"] == {}


def test_where_vehicles_will_fly_and_what_bounds_them_are_rows() -> None:
    picture = Picture()
    fence = {"name": EVIL, "centre": "58.0 15.0", "radius_m": 300.0, "highest_m": 120.0, "corners": ["58 15", "x"]}
    picture.take(1, kinds.FLIGHTS, flight("0", fences=[fence, 7], altitude_m=80.0, again=True))
    row = picture.sections()["flights"]["0"]
    assert (row["ahead"], row["again"], row["altitude"]) == ([[58.0, 15.0], [58.1, 15.1]], True, 80.0)
    [shown] = row["fences"]
    assert (shown["centre"], shown["radius"], shown["lowest"]) == ([58.0, 15.0], 300.0, None)
    assert shown["corners"] == [[58.0, 15.0]]
    assert "\x1b" not in shown["name"]


def test_the_places_where_an_object_may_be_stand_together_the_likeliest_first() -> None:
    picture = Picture((58.0, 15.0))
    for branch, x_m, weight in (("left", -50.0, 0.3), ("right", 50.0, 0.7)):
        message = sample("0", "object-tracks", 5, symbol="car1", x_m=x_m, y_m=0.0, end=False)
        picture.take(5, kinds.SAMPLE, {**message, "prediction": [1, branch, weight]})
    [row] = picture.sections()["objects"].values()
    assert [each[0] for each in row["others"]] == ["left", "right"]
    assert row["at"] == row["others"][1][1]
    picture.take(6, kinds.SAMPLE, sample("0", "object-tracks", 6, symbol="car1", x_m=60.0, y_m=0.0, end=False))
    [row] = picture.sections()["objects"].values()
    assert "others" not in row


def test_a_monitor_of_no_pair_has_the_margin_of_its_formula_as_a_curve() -> None:
    picture = Picture()
    entry = {"by": "0", "monitor": "slow", "units": ["0"], "which": [], "verdict": "undecided", "shows": "ok"}
    for second, margin in enumerate((4.0, 1.5, -2.0), 1):
        picture.take(second * 1_000_000, kinds.MONITOR, {**entry, "margin": margin})
    picture.take(4_000_000, kinds.LOST, {})
    assert [measure for _, measure in picture.curves()["0 slow 0"]] == [4.0, 1.5, -2.0]


def test_the_delay_of_an_import_is_shown_between_its_platforms() -> None:
    picture = Picture()
    one = {"owner": "1", "semantic_label": "heli-position", "hash": "h", "received": 5, "delay_s": 0.012}
    picture.take(1, kinds.IMPORTS, {"by": "0", "imports": [one]})
    assert next(iter(picture.sections()["links"].values()))["delay_us"] == 12_000


def test_a_goto_shows_where_the_vehicle_flies_until_it_holds() -> None:
    picture = Picture()
    act = "(request :sender user@cc-1 :receiver interface@0 :content {} :conversation-id cc-1-1)"
    log = {"by": "0", "at_us": 5, "direction": "in", "peer": "cc-1", "outcome": "accepted"}
    goto = "(goto latitude_deg: 58.01 longitude_deg: 15.02 altitude_m: 80.0)"
    picture.take(5, kinds.ACT, {**log, "act": act.format(goto)})
    [target] = picture.sections()["targets"].values()
    assert target["at"] == [58.01, 15.02, 80.0]
    picture.take(6, kinds.ACT, {**log, "act": act.format("(hold)")})
    assert not picture.sections()["targets"]
    assert [row["head"] for row in picture.sections()["acts"].values()] == ["goto", "hold"]


def test_a_stream_between_platforms_has_the_rate_of_its_receiver() -> None:
    picture = Picture()
    entry = {"owner": "1", "semantic_label": "heli-position", "hash": "ab", "received": 100, "lost": 0, "missing": 0}
    picture.take(1_000_000, kinds.IMPORTS, {"by": "0", "imports": [entry]})
    picture.take(3_000_000, kinds.IMPORTS, {"by": "0", "imports": [{**entry, "received": 120, "lost": 2}]})
    [link] = picture.sections()["links"].values()
    assert (link["from"], link["to"], link["rate"], link["lost"]) == ("1", "0", 10.0, 2)


def test_a_question_of_a_mission_is_there_until_the_mission_is_not() -> None:
    picture = Picture()
    question = {"number": 1, "text": "Drop it?", "options": ["yes", "no"], "default": "no", "until_us": 9}
    entry = {
        "mission": "m1",
        "conversation": "c",
        "phase": "asks",
        "since_us": 1,
        "actions": ["fly"],
        "question": question,
    }
    picture.take(1, kinds.MISSIONS, {"by": "0", "missions": [entry]})
    [row] = picture.sections()["missions"].values()
    assert row["question"]["options"] == ["yes", "no"]
    picture.take(2, kinds.MISSIONS, {"by": "0", "missions": []})
    assert not picture.sections()["missions"]


def test_text_from_others_has_no_control_characters_and_is_not_endless() -> None:
    picture = Picture()
    picture.take(1, foxglove.LOG, foxglove.log_entry(1, foxglove.ERROR, EVIL * 100, "7"))
    picture.take(1, kinds.PLATFORM, {"unit": EVIL, "state": EVIL})
    [event] = picture.sections()["events"].values()
    assert event["text"].isprintable()
    assert len(event["text"]) <= 400
    assert all(name.isprintable() for name in picture.sections()["platforms"])


def test_a_section_keeps_the_newest_rows_only() -> None:
    picture = Picture()
    for at in range(2 * MOST_OTHERS):
        picture.take(at, foxglove.LOG, foxglove.log_entry(at, foxglove.INFO, str(at), ""))
    assert [row["text"] for row in picture.sections()["events"].values()][-1] == str(2 * MOST_OTHERS - 1)
    assert len(picture.sections()["events"]) == MOST_OTHERS


values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8) | st.just(EVIL),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(
        ["unit", "label", "value", "labels", "by", "monitor", "units", "imports", "missions", "mission", "question", "id"]
    ), inner, max_size=4),
    max_leaves=8,
)  # fmt: skip
messages = st.tuples(
    st.sampled_from(KINDS),
    st.dictionaries(st.sampled_from([
        "unit", "label", "valid_us", "value", "state", "labels", "id", "event", "monitor", "by", "units", "which", "change",
        "conversation", "missions", "imports", "act", "direction", "peer", "level", "message", "messages", "values", "because",
    ]), values, max_size=8),
)  # fmt: skip


@given(st.lists(messages, max_size=12))
def test_no_message_breaks_the_picture_and_all_of_it_can_be_sent(sent: list[tuple[str, dict[str, Any]]]) -> None:
    picture = Picture((58.0, 15.0))
    for at_us, (schema, message) in enumerate(sent):
        picture.take(at_us, schema, message)
    json.dumps(picture.sections(), allow_nan=False)


@given(st.lists(messages, max_size=10), st.lists(messages, max_size=10))
def test_the_difference_of_two_pictures_makes_the_one_the_other(
    first: list[tuple[str, dict[str, Any]]], then: list[tuple[str, dict[str, Any]]]
) -> None:
    picture = Picture()
    for at_us, (schema, message) in enumerate(first):
        picture.take(at_us, schema, message)
    before = picture.sections()
    for at_us, (schema, message) in enumerate(then):
        picture.take(at_us, schema, message)
    after = picture.sections()
    assert applied(before, difference(before, after)) == after
    assert not difference(after, picture.sections())


def test_any_moment_of_a_recording_is_the_picture_that_was_then() -> None:
    feed = RecordedFeed(FederationRecording(RECORDING), None)
    feed.load()
    first_us, last_us = feed.span_us
    player = RecordingViewer(feed, lambda: 0.0)
    for at_us in (last_us, first_us + 9_000_000, first_us + 9_500_000, first_us, last_us - 1):
        player.steer({"at_us": at_us})
        stepped = Picture()
        for each in feed.recording.messages(lambda topic: not topic.endswith(("/fix", "/pose"))):
            if each.at_us <= at_us:
                stepped.take(each.at_us, each.schema, each.message)
        shown = player.look()
        assert shown.at_us == at_us
        assert {name: shown.sections[name] for name in SECTIONS} == stepped.sections()


def test_a_playback_runs_at_its_speed_and_stops_at_the_end() -> None:
    feed = RecordedFeed(FederationRecording(RECORDING), None)
    feed.load()
    seconds = [0.0]
    player = RecordingViewer(feed, lambda: seconds[0])
    first_us, last_us = feed.span_us
    player.steer({"play": True, "speed": 2})
    seconds[0] = 3.0
    assert player.look().at_us == first_us + 6_000_000
    player.steer({"play": True, "speed": float("nan"), "at_us": True})
    seconds[0] = 1000.0
    assert player.look().at_us == last_us


def test_the_slider_has_when_alarms_were_open() -> None:
    feed = RecordedFeed(FederationRecording(RECORDING), None)
    feed.load()
    first_us, last_us = feed.span_us
    assert len(feed.marks) == 4
    assert all(
        closed_us is not None and first_us <= opened_us < closed_us <= last_us for opened_us, closed_us in feed.marks
    )


def test_a_leap_in_a_recording_brings_the_trails_of_that_moment() -> None:
    feed = RecordedFeed(FederationRecording(RECORDING), None)
    feed.load()
    player = RecordingViewer(feed, lambda: 0.0)
    before = player.look()
    player.steer({"at_us": feed.span_us[0] + 8_000_000})
    assert player.look().run != before.run
    assert all(len(trail) >= 7 for trail in player.past().trails.values())
    assert all(len(curve) >= 7 for curve in player.past().curves.values())
