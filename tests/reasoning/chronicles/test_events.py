"""Events on disk."""

import pytest

from dyknow import Label
from dyknow.model.errors import TextError
from dyknow.reasoning.chronicles import MINUS_INFINITY
from dyknow.reasoning.chronicles.recognition.events import RecordedEvent, read_events


def test_changes_messages_and_the_clock_are_read() -> None:
    lines = [
        '{"t_ms": 100, "attribute": "link[car1]", "from": "l1", "to": "no_link"}',
        "",
        '{"t_ms": 100.9, "attribute": "cars.speed[car1]", "from": null, "to": 2.0}',
        '{"t_ms": -0.5, "message": "in_crossing[car1, 2]"}',
        '{"t_ms": "-oo", "attribute": "wet", "from": false, "to": "1.5"}',
        '{"t_ms": 7}',
    ]
    assert list(read_events(lines)) == [
        RecordedEvent(100, Label("link", ("car1",)), ("l1", "no_link"), 1),
        RecordedEvent(100, Label("cars.speed", ("car1",)), (None, "2"), 3),
        RecordedEvent(-1, Label("in_crossing", ("car1", "2")), None, 4),
        RecordedEvent(MINUS_INFINITY, Label("wet"), ("false", "1.5"), 5),
        RecordedEvent(7, None, None, 6),
    ]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("{", "no JSON"),
        ('{"t_ms": NaN, "message": "m"}', "NaN is no value"),
        ('{"t_ms": Infinity, "message": "m"}', "Infinity is no value"),
        ('{"t_ms": true, "message": "m"}', "an event has a time, t_ms"),
        ('{"t_ms": 1e300, "message": "m"}', "an event has a time, t_ms"),
        ('{"t_ms": ' + "9" * 5_000 + ', "message": "m"}', "no JSON"),
        ("[1, 2]", "an event is a JSON object"),
        ("[" * 100_000, "no JSON"),
        ('{"message": "m"}', "an event has a time, t_ms"),
        ('{"t_ms": 1, "message": "m("}', "message: expected a feature name"),
        ('{"t_ms": 1, "message": 5}', "message is a label"),
        ('{"t_ms": 1, "messag": "m"}', "'messag' is nothing that an event has"),
        ('{"t_ms": 1, "attribute": "a", "to": 5}', "a change has 'from'"),
        ('{"t_ms": 1, "attribute": "a", "from": null}', "a change has 'to'"),
        ('{"t_ms": 1, "attribute": "a", "from": null, "to": null}', "an attribute changes to a value"),
        ('{"t_ms": 1, "attribute": "a", "from": null, "to": [1]}', "neither a text, a whole number, nor a truth value"),
        (
            '{"t_ms": 1, "attribute": "a", "from": null, "to": 1e999}',
            "neither a text, a whole number, nor a truth value",
        ),
        ('{"t_ms": 1, "attribute": "a", "from": 1, "to": "' + "x" * 600 + '"}', "512 are allowed"),
        ('{"t_ms": 1, "message": "' + "x" * 2_000_000 + '"}', "longer than 1048576 characters"),
    ],
)
def test_a_line_that_is_no_event_is_told_by_file_and_line(line: str, said: str) -> None:
    with pytest.raises(TextError) as told:
        list(read_events(['{"t_ms": 1, "message": "fine"}', "", line], "road.jsonl"))
    assert said in str(told.value)
    assert str(told.value).startswith("road.jsonl:3")
    assert told.value.repair
    assert len(str(told.value)) < 1_000
