"""Streams and monitors over what is predicted, from KPL to the alarm (thesis 12.3)."""

import pytest

from dyknow import Sample
from dyknow.kpl import parse_specification, print_specification
from dyknow.kpl.introspection.records import alarm_record, sample_json
from dyknow.model.errors import TextErrors
from dyknow.model.sample import Predicted
from tests.kpl.instances import Running

S = 1_000_000
GAP = "source number near\nstrmgen gap[car1] = near\n"
CLOSE = "monitor close = always gap[car1] > 10 with sample every 100, predict 30s\n"


def approach(running: Running, speed: float = -2.0, until_s: int = 60) -> None:
    """From 100 m the gap closes by `speed` metres a second, a sample ten times a second."""
    for at in range(until_s * 10 + 1):
        running.push("near", 100.0 + speed * at / 10, at * 100_000)


def test_the_closest_approach_within_thirty_seconds_is_a_monitor() -> None:
    running = Running(GAP + CLOSE)
    approach(running, until_s=20)
    [alarm] = running.alarms
    assert (alarm.event, alarm.monitor) == ("opened", "close")
    assert alarm.valid_us == 45 * S, "when the gap will be 10 m"
    assert alarm.detected_us == 15 * S, "thirty seconds before"
    assert alarm.made_us == 15 * S, "it says that it rests on a prediction, and on what"
    assert alarm_record(alarm)["made_us"] == 15 * S


def test_the_same_over_what_is_measured_opens_when_it_is_so_and_says_nothing_of_predictions() -> None:
    running = Running(GAP + CLOSE.replace(", predict 30s", ""))
    approach(running)
    [alarm] = running.alarms
    assert (alarm.valid_us, alarm.made_us) == (45 * S, None)
    assert "made_us" not in alarm_record(alarm)


def test_a_predicted_stream_is_a_stream_whose_samples_say_when_they_were_made() -> None:
    running = Running(GAP + "stream soon = gap[car1] with sample every 1s, from 0 to oo, predict 5s\n")
    approach(running, until_s=3)
    soon = [sample for name, sample in running.outputs if name == "soon"]
    assert [sample.valid_us for sample in soon] == [6 * S, 7 * S, 8 * S]
    assert [sample.quality.prediction for sample in soon] == [Predicted(at * S) for at in (1, 2, 3)]
    assert sample_json(soon[0])["prediction"] == [S, "", 1.0]


def test_what_is_computed_from_a_prediction_is_one_and_so_is_an_alarm_over_it() -> None:
    text = "strmgen twice[car1] = Double(gap[car1] with predict 10s)\nmonitor far = always twice[car1] > 20 with sample every 100\n"
    running = Running(GAP + "compunit number Double(number)\n" + text)
    approach(running, until_s=40)
    [alarm] = running.alarms
    assert (alarm.valid_us, alarm.detected_us, alarm.made_us) == (45 * S, 35 * S, 35 * S)


def test_a_monitor_over_predictions_is_unknown_soon_after_its_inputs_end() -> None:
    running = Running(GAP + CLOSE)
    approach(running, speed=0.0, until_s=5)
    monitor = running.instance.monitors["close"].monitor
    assert monitor.inputs == "fresh"
    running.wait(7 * S)
    assert monitor.inputs == "stale", "not thirty seconds later"


def test_predictions_that_are_too_old_are_not_taken() -> None:
    running = Running(GAP + CLOSE.replace("predict 30s", "predict 30s, max age of prediction 50ms"))
    for at in range(200):
        running.instance.push("near", Sample(at * 100_000 + 200_000, at * 100_000, 100.0 - at / 5))
        running.wait(at * 100_000 + 200_000)
    assert running.alarms == []


def test_what_is_declared_is_printed_and_read_back_and_a_derived_feature_is_refused_with_the_remedy() -> None:
    text = GAP + CLOSE
    assert parse_specification(print_specification(parse_specification(text))) == parse_specification(text)
    with pytest.raises(TextErrors, match="after now"):
        parse_specification(CLOSE.replace("30s", "0"))
