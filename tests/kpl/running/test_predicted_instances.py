"""What is recognised of a prediction says so: the sample of the stream, what `kpl run` prints, and its JSON."""

import json

import numpy as np
import pytest

from dyknow import SURE, Predicted, Quality, Sample
from tests.command import run
from tests.docs.pages import ROOT, environment
from tests.kpl.running.test_chronicle_streams import STREAMS, Run

EVENTS = (
    (1000, "links", "l1"),
    (2000, "links", "no_link"),
    (2500, "links", "no_link"),
    (3000, "crossings", True),
    (4000, "links", "l2"),
)
USED = {2000, 3000, 4000}
COUNTED = """
attribute link[?car]
chronicle enters[?car] {
    occurs(2, 2, link[?car]:(?, ?), (t1, t2))
    t1 = t2 - 5s
}
"""


@pytest.mark.parametrize("seed", range(12))
def test_an_instance_is_predicted_if_one_of_its_events_is(seed):
    rng = np.random.default_rng(seed)
    predicted = {at_ms: at_ms - int(rng.integers(1, 900)) for at_ms, *_ in EVENTS if rng.random() < 0.35}
    run_ = Run()
    run_.feed("cars", 0, ("a",))
    for at_ms, source, value in EVENTS:
        made_ms = predicted.get(at_ms)
        quality = SURE if made_ms is None else Quality(prediction=Predicted(1000 * made_ms))
        run_.at(at_ms)
        run_.instance.push(source, Sample(1000 * at_ms, 1000 * at_ms, value, quality))
    run_.at(4200)
    ((_, sample),) = run_.told
    oldest = min((made_ms for at_ms, made_ms in predicted.items() if at_ms in USED), default=None)
    assert sample.quality.prediction == (None if oldest is None else Predicted(1000 * oldest))


@pytest.mark.parametrize("which", [2, 3, None])
def test_an_event_that_is_only_counted_may_be_predicted_and_the_same_is_measured_later(which):
    text = STREAMS.replace("stream lorry_turned = chronicle[enters, lorry, l1, l2]\n", "")
    run_ = Run(text, COUNTED)
    run_.feed("cars", 0, ("a",))
    for number, (at_ms, value) in enumerate([(0, "l1"), (1000, "l2"), (2000, "l1"), (3000, "l2")]):
        quality = Quality(prediction=Predicted(1)) if number == which else SURE
        run_.at(at_ms)
        run_.instance.push("links", Sample(1000 * at_ms, 1000 * at_ms, value, quality))
    run_.at(20_000)
    assert run_.told
    assert any(sample.quality.prediction is not None for _, sample in run_.told) is (which is not None)


def test_a_run_prints_how_far_ahead_and_writes_it_as_json(tmp_path):
    (tmp_path / "enters.chr").write_text(
        "attribute cars.link[?c]\nchronicle enters[?c] { event(cars.link[?c]:(?, l2), t) }\n", "utf-8"
    )
    (tmp_path / "run.kpl").write_text(
        "sort place(symbol in text, x_m in m, y_m in m, link in text)\nsource place seen\n"
        "strmgen seen_cars = seen\n"
        "compunit place Ahead(place)\nfor c in seen_cars strmgen cars[c] = Ahead(seen_cars[c])\n"
        'chronicle file "enters.chr" with max delay 100\nstream entered = chronicle[enters]\n',
        "utf-8",
    )
    (tmp_path / "units.py").write_text(
        "from dyknow import Predicted, Quality, Sample, computational_unit\n"
        '@computational_unit("place", "place", name="Ahead")\n'
        "def ahead(now_us, sample):\n"
        '    link = "l2" if sample.value[1] > 10 else "l1"\n'
        "    made = Predicted(sample.valid_us - 700_000) if sample.value[1] > 10 else None\n"
        "    return Sample(now_us, sample.valid_us, (*sample.value[:3], link), Quality(prediction=made))\n",
        "utf-8",
    )
    rows = [{"t_ms": 100 * i, "seen": ["a", 1.0 * i, 0.0, "l1"]} for i in range(30)]
    (tmp_path / "feed.jsonl").write_text("".join(f"{json.dumps(row)}\n" for row in rows), "utf-8")
    call = [
        "kpl", "run", str(tmp_path / "run.kpl"), "--units", str(tmp_path / "units.py"),
        "--feed", str(tmp_path / "feed.jsonl"),
    ]  # fmt: skip
    shown = run(call, environment(tmp_path), ROOT)
    assert "entered" in shown.stdout, shown.stderr
    assert "predicted 700 ms ahead" in shown.stdout
    written = run([*call, "--json"], environment(tmp_path), ROOT)
    (sample,) = [each for each in map(json.loads, written.stdout.splitlines()) if each.get("stream") == "entered"]
    assert sample["prediction"][0] == sample["valid_us"] - 700_000
