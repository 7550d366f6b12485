"""Cursor on Target: what the event schema asks of each field, read by another parser, whatever the names are."""

import re
from datetime import datetime
from typing import Any
from xml.dom.minidom import parseString

from hypothesis import given
from hypothesis import strategies as st

from dyknow.proxies.outward.cot import ALARM, LONGEST_NAME, UAV, UNKNOWN_GROUND, CotMotion, CotPoint, cot_event

AT_US = 1_795_461_223_065_000
TIME = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z")
HOSTILE = '"/><event uid="x"><!-- \x1b]0;t\x07\u202e &amp; ]]>\ud800\x00'


def event_of(name: str = "7", kind: str = UAV, point: CotPoint | None = None, **options: Any) -> Any:
    point = point or CotPoint(58.4, 15.6, 60.0, 1.5, 2.0)
    data = cot_event(
        name, kind, name, point, time_us=AT_US, now_us=AT_US + 50_000, stale_us=AT_US + 5_000_000, **options
    )
    assert len(data) < 2000
    document = parseString(data.decode("utf-8"))
    check(document.documentElement)
    return document.documentElement


def check(event: Any) -> None:
    """The facets of the event schema, 2.0."""
    assert event.tagName == "event"
    assert set(dict(event.attributes.items())) == {"version", "uid", "type", "how", "time", "start", "stale"}
    assert float(event.getAttribute("version")) == 2.0
    assert re.fullmatch(r"\w(-\w+)*(;[^;]*)?", event.getAttribute("type"))
    assert re.fullmatch(r"\w(-\w+)*", event.getAttribute("how"))
    assert event.getAttribute("uid").strip()
    times = [event.getAttribute(name) for name in ("start", "time", "stale")]
    assert all(TIME.fullmatch(each) for each in times)
    assert [*map(datetime.fromisoformat, times)] == sorted(map(datetime.fromisoformat, times))
    assert [each.tagName for each in event.childNodes] == ["point", "detail"]
    point = {name: float(value) for name, value in event.childNodes[0].attributes.items()}
    assert set(point) == {"lat", "lon", "hae", "ce", "le"}
    assert abs(point["lat"]) <= 90
    assert abs(point["lon"]) <= 180
    assert 0 <= point["ce"] <= 9_999_999.0
    assert 0 <= point["le"] <= 9_999_999.0
    assert [each.tagName for each in event.childNodes[1].childNodes][:1] == ["contact"]


def test_a_platform_is_a_friendly_drone_where_it_is_with_its_errors_and_its_motion() -> None:
    event = event_of(motion=CotMotion(-90.0, 4.25), undulation_m=28.5)
    point, detail = event.childNodes
    assert event.getAttribute("type") == "a-f-A-M-H-Q"
    assert event.getAttribute("start") == "2026-11-23T19:13:43.065Z"
    assert (float(point.getAttribute("lat")), float(point.getAttribute("lon"))) == (58.4, 15.6)
    assert [point.getAttribute(name) for name in ("hae", "ce", "le")] == ["88.50", "1.5", "2.0"]
    track = detail.getElementsByTagName("track")[0]
    assert (track.getAttribute("course"), track.getAttribute("speed")) == ("270.0", "4.25")


def test_without_the_geoid_the_height_has_its_error_and_what_is_unknown_is_so() -> None:
    point = event_of().childNodes[0]
    assert [point.getAttribute(name) for name in ("hae", "le")] == ["60.00", "109.0"]
    point = event_of(point=CotPoint(58.4, 15.6)).childNodes[0]
    assert [point.getAttribute(name) for name in ("ce", "le")] == ["9999999.0", "9999999.0"]


def test_hostile_names_are_text_of_one_event() -> None:
    event = event_of(HOSTILE, ALARM, text=HOSTILE * 10)
    assert len(event.getElementsByTagName("event")) == 0
    shown = event.getElementsByTagName("contact")[0].getAttribute("callsign")
    assert '"/><event uid="x"><!--' in shown
    assert not any(each in shown for each in "\x1b\x07\u202e\x00\ud800")


@given(st.text(), st.sampled_from([UAV, UNKNOWN_GROUND, ALARM]), st.text())
def test_whatever_a_name_is_the_event_is_one_of_the_schema(name: str, kind: str, text: str) -> None:
    event = event_of(name, kind, text=text)
    assert len(event.getElementsByTagName("contact")[0].getAttribute("callsign")) <= LONGEST_NAME
