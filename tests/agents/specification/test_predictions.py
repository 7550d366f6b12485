"""Predicted samples between platforms: exported, imported, queried, alarmed on, and marked everywhere (thesis 12.3)."""

import pytest

from dyknow import Predicted, Quality
from dyknow.agents.config import PlatformConfig
from dyknow.agents.effects import Fed
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import AlarmList, Query, Samples
from dyknow.runtime.library.results import sample_of_reading
from tests.box import Box

LABEL = 'label gap-ahead : gap in m "how far the next car is"\n'
EXPORTING = f"{LABEL}source gap sensor\nstrmgen gap[self] = sensor\nexport gap-ahead = gap[self] with sample every 100ms, from 0 to oo, predict 5s\n"
IMPORTING = (
    f"{LABEL}import gap-ahead from 1 as gap[uav1] with sample every 100ms, max delay 500ms\nstream seen = gap[uav1]\n"
)
MONITOR = "monitor close = always gap[uav1] > 10 with sample every 100ms, max delay 500ms\n"
PERIOD_US, S = 100_000, 1_000_000


def pair(wire: Box, exporting: str = EXPORTING, importing: str = IMPORTING) -> None:
    for unit, text in (("0", importing), ("1", exporting)):
        wire.join(unit)
        wire.specify(unit, text)
    wire.centre()
    begin_us = wire.now_us

    def read() -> None:
        valid_us = wire.now_us - wire.now_us % PERIOD_US
        gap = 40.0 - 2.0 * (valid_us - begin_us) / S
        wire.happens("1", Fed(wire.now_us, "sensor", valid_us, gap))
        wire.at(wire.now_us + PERIOD_US, read)

    wire.at(begin_us, read)


def told(wire: Box, event: str) -> list[dict[str, object]]:
    return [dict(each) for each in wire.nodes["0"].results if each["event"] == event]


def test_what_one_exports_as_predicted_is_so_where_it_is_imported(wire: Box) -> None:
    pair(wire)
    wire.run(4)
    samples = told(wire, "sample")
    assert len(samples) > 20
    for sample in samples:
        made_us, branch, weight = sample["prediction"]  # type: ignore[misc]
        assert (sample["valid_us"] - made_us, branch, weight) == (5 * S, "", 1.0)  # type: ignore[operator]


def test_a_query_says_when_the_value_was_made(wire: Box) -> None:
    pair(wire)
    wire.run(3)
    [content] = wire.asked("cc", "1", Query(semantic_label="gap-ahead"), Performative.QUERY_REF).contents
    assert isinstance(content, Samples)
    sample = sample_of_reading("1", "gap-ahead", content.samples[-1])
    assert sample.quality.prediction == Predicted(sample.valid_us - 5 * S)


def test_an_alarm_over_an_imported_prediction_says_so_to_all(wire: Box) -> None:
    pair(wire, importing=IMPORTING + MONITOR)
    wire.run(14)
    [alarm] = told(wire, "alarm-opened")
    assert alarm["made_us"] == alarm["valid_us"] - 5 * S  # type: ignore[operator]
    assert alarm["detected_us"] < alarm["valid_us"]  # type: ignore[operator]
    [content] = wire.asked("cc", "0", AlarmList(), Performative.QUERY_REF).contents
    assert isinstance(content, AlarmList)
    assert content.alarms is not None
    assert [each.made_us for each in content.alarms] == [alarm["made_us"]]


def test_branches_and_weights_travel(wire: Box) -> None:
    pair(wire, EXPORTING.replace("sample every 100ms, from 0 to oo, predict 5s", "sample every 100ms, from 0 to oo"))
    wire.run(1)
    made = Predicted(wire.now_us, "left", 0.75)
    valid_us = wire.now_us - wire.now_us % PERIOD_US + 3 * S
    wire.happens("1", Fed(wire.now_us, "sensor", valid_us, 1.0, Quality(0.9, (), made)))
    wire.run(1)
    assert [each["prediction"] for each in told(wire, "sample") if "prediction" in each] == [list(made)]


def test_the_time_of_making_is_corrected_as_valid_times_are() -> None:
    wire = Box()
    wire.join("0")
    wire.specify("0", IMPORTING)
    wire.add("1", PlatformConfig("1", 0), offset_us=300_000)
    wire.specify("1", EXPORTING)
    wire.centre()

    def read() -> None:
        local_us = wire.now_us + 300_000
        wire.happens("1", Fed(local_us, "sensor", local_us - local_us % PERIOD_US, 1.0))
        wire.at(wire.now_us + PERIOD_US, read)

    wire.at(wire.now_us, read)
    wire.run(12)
    samples = [each for each in told(wire, "sample") if "prediction" in each]
    assert samples
    for sample in samples[-5:]:
        ahead_us = sample["valid_us"] - sample["prediction"][0]  # type: ignore[index,operator]
        assert ahead_us == pytest.approx(5 * S, abs=PERIOD_US + 1000)


def test_a_monitor_of_pairs_refuses_to_predict_a_derived_feature_with_the_remedy(wire: Box) -> None:
    wire.join("0")
    wire.specify("0", "monitor m = always forall o in units - {self} growing: xy_dist[self, o] > 15 with predict 5s")
    wire.run(0.5)
    assert any("cpa_time" in note for note in (*wire.nodes["0"].notes, *map(str, wire.nodes["0"].results)))
