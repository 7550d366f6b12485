"""Figures 8.6 and 8.12 as specifications: they are run on recorded positions, and drawn as the figures are."""

import json
import shutil
from functools import cache
from itertools import pairwise

import pytest

from tests.command import run
from tests.docs.pages import ROOT, environment
from tests.thesis.traffic.written import EXAMPLES

MORE = {"overtakes.kpl": (), "monitoring.kpl": ("--units", str(EXAMPLES / "town.py"))}
FEEDS = {"overtakes.kpl": "seen_cars.jsonl", "monitoring.kpl": "vision_objects.jsonl"}


@cache
def lines(name, folder):
    """What a run brings, as (milliseconds, stream or monitor, event or value)."""
    done = run(
        ["kpl", "run", str(EXAMPLES / name), *MORE[name], "--feed", str(EXAMPLES / FEEDS[name]), "--json"],
        environment(folder),
        ROOT,
    )
    assert done.returncode == 0, done.stderr
    every = map(json.loads, done.stdout.splitlines())
    return [
        (each["valid_us"] // 1000, each.get("stream") or each["monitor"], each.get("value", each["event"]))
        for each in every
        if each["event"] in {"sample", "alarm-opened", "alarm-closed"}
    ]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("run")
    yield made
    shutil.rmtree(made)


def test_figure_8_12_an_overtake_and_that_it_was_reckless_are_recognised_from_positions(folder):
    brought = [
        (at, name, value) for at, name, value in lines("overtakes.kpl", folder) if not name.startswith("watched")
    ]
    arguments = [(at, name, value[0] if isinstance(value, list) else value) for at, name, value in brought]
    assert arguments[:3] == [
        (11_900, "passed", ["a", "b"]),
        (11_900, "too_near", ["a", "b", "c"]),
        (11_900, "reckless", "a"),
    ]
    assert [(name, value) for _, name, value in arguments[3:]] == [
        ("keeps_off", "alarm-opened"),
        ("keeps_off", "alarm-closed"),
    ]
    assert brought[2][2] == ["a"]


def test_8_2_2_what_is_declared_for_reckless_cars_is_there_once_there_is_one(folder):
    watched = [(at, name) for at, name, _ in lines("overtakes.kpl", folder) if name.startswith("watched")]
    assert {name for _, name in watched} == {"watched-a"}
    assert watched[0][0] >= 11_600
    assert {later - earlier for (earlier, _), (later, _) in pairwise(watched)} == {1000}


def test_figure_8_6_both_tasks_are_monitored_at_once_and_a_car_keeps_its_symbol_through_a_gap(folder):
    """The second car is lost for three seconds between the overtake and the crossing."""
    assert [(name, value[0]) for _, name, value in lines("monitoring.kpl", folder)] == [
        ("passes", ["co1", "co2"]),
        ("turns_left", ["co1", "l1", "x1", "l3"]),
        ("goes_straight", ["co2", "l1", "x1", "l2"]),
    ]


def test_turns_are_recognised_on_a_map_whose_ids_are_no_names_of_objects(folder, tmp_path):
    """As SUMO (`-103` is the way back) and OpenStreetMap (`4711.0` is a part of a way) have them."""
    town = (EXAMPLES / "town.geojson").read_text("utf-8")
    for plain, odd in {"l1": "4711.0", "l2": "-103", "l3": "4711.1", "l4": "103", "x1": "cluster:1 2"}.items():
        town = town.replace(f'"{plain}"', f'"{odd}"')
    (tmp_path / "town.geojson").write_text(town, "utf-8")
    shutil.copy(EXAMPLES / "town.py", tmp_path)
    done = run(
        ["kpl", "run", str(EXAMPLES / "monitoring.kpl"), "--units", str(tmp_path / "town.py"),
         "--feed", str(EXAMPLES / FEEDS["monitoring.kpl"]), "--json"],
        environment(folder),
        ROOT,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "names no object" not in done.stderr
    every = [json.loads(each) for each in done.stdout.splitlines()]
    found = [
        (each["stream"], each["value"][0]) for each in every if each.get("stream") in {"turns_left", "goes_straight"}
    ]
    assert found == [
        ("turns_left", ["co1", "_4711_0", "cluster_1_2", "_4711_1"]),
        ("goes_straight", ["co2", "_4711_0", "cluster_1_2", "_103"]),
    ]


CHAINS = {
    "overtakes.kpl": [
        ("seen_cars", "car_pairs"),
        ("seen_cars.objects", "car[c]", "car_relations[a, b]"),
        ("car_relations[a, b]", "overtakes.chr", "chronicle[wrong_side]", "on_wrong_side"),
        ("reckless_cars", "keeps_off"),
        ("car_pairs", "car_relations[a, b]"),
        ("overtakes.chr", "chronicle[passes]", "passed"),
        ("chronicle[oncoming_too_near]", "met_too_near", "one_of_two", "reckless_cars", "reckless"),
    ],
    "monitoring.kpl": [
        ("vision_objects", "car_objects", "car_objects.objects", "on_map[c]"),
        ("car_objects.objects", "cars[c]"),
        ("on_map[c]", "car[c]", "area[c]", "cars[c]", "turns.chr"),
        ("links.left[l, x, m]", "turns.chr"),
        ("car_objects", "car_pairs"),
        ("car_pairs", "car_relations[a, b]"),
        ("left_turns", "links.left[l, x, m]"),
        ("turns.chr", "chronicle[turn_left_in_crossing]", "turns_left"),
        ("overtakes.chr", "chronicle[passes]", "passes"),
    ],
}


@pytest.mark.parametrize("name", CHAINS)
def test_the_figures_are_drawn_as_chains_from_what_is_seen_to_events(name, folder):
    done = run(["kpl", "graph", str(EXAMPLES / name), *MORE[name], "--form", "json"], environment(folder), ROOT)
    graph = json.loads(done.stdout)
    edges = {(each["source"], each["target"]) for each in graph["edges"]}
    missing = [edge for chain in CHAINS[name] for edge in pairwise(chain) if edge not in edges]
    assert missing == []


@pytest.mark.parametrize(
    ("name", "figure"), [("overtakes.kpl", "figure-8.12.svg"), ("monitoring.kpl", "figure-8.6.svg")]
)
def test_the_pictures_in_the_documentation_are_those_of_the_specifications(name, figure, folder):
    done = run(["kpl", "graph", str(EXAMPLES / name), *MORE[name], "--form", "svg"], environment(folder), ROOT)
    assert done.stdout == (ROOT / "docs" / "figures" / figure).read_text(encoding="utf-8")


@pytest.mark.parametrize("has_end", [False, True])
def test_a_car_that_left_the_view_is_not_overtaken_and_one_that_is_seen_again_in_time_is(has_end, folder, tmp_path):
    """Two cars at one speed, of which the one in front leaves; then one that is passed while it is hidden for two seconds."""
    rows = []
    for at_ms in range(0, 30_000, 100):
        rows.append((at_ms, "a", 0.012 * at_ms, False))
        if at_ms <= 5_000:
            rows.append((at_ms, "b", 30.0 + 0.012 * at_ms, at_ms == 5_000))
        if not 14_000 <= at_ms < 16_000:
            rows.append((at_ms, "c", 80.0 + 0.007 * at_ms, False))
    feed = tmp_path / "seen.jsonl"
    places = ((at, [car, x_m, 0.0, 90.0, "l1", "no_crossing", *[end][:has_end]]) for at, car, x_m, end in rows)
    feed.write_text("".join(f"{json.dumps({'t_ms': at, 'seen': place})}\n" for at, place in places), "utf-8")
    text = (EXAMPLES / "overtakes.kpl").read_text("utf-8")
    more = "crossing in text, end in bool)" if has_end else "crossing in text)"
    (tmp_path / "overtakes.kpl").write_text(text.replace("crossing in text)", more), "utf-8")
    shutil.copy(EXAMPLES / "overtakes.chr", tmp_path)
    done = run(
        ["kpl", "run", str(tmp_path / "overtakes.kpl"), "--feed", str(feed), "--json"], environment(folder), ROOT
    )
    assert done.returncode == 0, done.stderr
    passed = [each for each in map(json.loads, done.stdout.splitlines()) if each.get("stream") == "passed"]
    assert [each["value"][0] for each in passed] == [["a", "c"]]
