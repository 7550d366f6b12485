"""Minutes of a motorway on a map that cuts it into links, with and without an entrance or an exit at a border (8.7.5)."""

import json

import pytest

from bench.traffic.cut_roads import cut_road, placed
from bench.traffic.manoeuvres import Score, reported, score
from bench.traffic.motorway import minute
from tests.command import run
from tests.docs.pages import ROOT, environment
from tests.thesis.traffic.written import EXAMPLES

LEAST = 0.95
SPECIFICATION = """
sort seen-object(symbol in text, x_m in m, y_m in m)
source seen-object seen
strmgen seen_cars = seen
compunit seen-car OnMap(seen-object)
compunit car CarInLane(seen-car)
for c in seen_cars strmgen on_map[c] = OnMap(seen_cars[c])
for c in seen_cars strmgen car[c] = CarInLane(on_map[c])
compunit pairs NearPairs(seen-object)
compunit road-relations RelationsOnMap(car, car)
strmgen car_pairs = NearPairs(seen_cars)
for a, b in car_pairs strmgen car_relations[a, b] = RelationsOnMap(car[a], car[b])
chronicle file "overtakes.chr" with max delay 500
stream passed = chronicle[passes]
"""


def recognised(made, roads, folder):
    """The score of the overtakes of a minute on a map."""
    (folder / "town.geojson").write_text(roads, "utf-8")
    (folder / "feed.jsonl").write_text("".join(f"{json.dumps(each)}\n" for each in placed(made)), "utf-8")
    for name in ("town.py", "overtakes.chr"):
        (folder / name).write_text((EXAMPLES / name).read_text("utf-8"), "utf-8")
    (folder / "passes.kpl").write_text(SPECIFICATION, "utf-8")
    call = ["kpl", "run", str(folder / "passes.kpl"), "--units", str(folder / "town.py"),
            "--feed", str(folder / "feed.jsonl"), "--json"]  # fmt: skip
    done = run(call, environment(folder), ROOT)
    assert done.returncode == 0, done.stderr
    return score(made, reported(map(json.loads, done.stdout.splitlines()), "passed"))


def test_8_7_5_overtakes_on_a_road_of_several_links_are_those_on_a_road_of_one(tmp_path):
    made = minute(1, 0.5, seconds=15.0)
    whole = recognised(made, cut_road(made, 1, 1), tmp_path)
    cut = recognised(made, cut_road(made, 1, 5, "entrance"), tmp_path)
    print(whole, cut)
    assert cut.clear >= 6
    assert cut.precision >= max(LEAST, whole.precision - 0.02)
    assert cut.recall >= max(LEAST, whole.recall - 0.02)
    assert cut.unseen == 0


@pytest.mark.full
def test_8_7_5_overtakes_on_roads_cut_at_drawn_places(tmp_path):
    total = Score()
    for seed in range(8):
        made = minute(seed, (0.0, 0.5, 1.0)[seed % 3], seconds=40.0)
        roads = cut_road(made, seed, 3 + seed % 4, ("", "entrance", "exit")[seed // 2 % 3])
        total = total.plus(recognised(made, roads, tmp_path))
    print(total, total.precision, total.recall)
    assert total.clear >= 100
    assert total.precision >= LEAST
    assert total.recall >= LEAST
    assert total.unseen == 0
