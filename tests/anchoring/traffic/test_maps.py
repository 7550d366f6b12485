"""Turns are recognised on any map: cars of seeds are driven over one set of roads that is written in three formats."""

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dyknow.anchoring.roads.files.formats import GEOJSON, OPENSTREETMAP, SUMO, format_of, read_roads
from dyknow.anchoring.roads.files.summary import summary_of
from dyknow.anchoring.roads.network import RoadNetwork
from tests.anchoring.traffic.drawn_towns import ORIGIN, SUMO_SHIFT, Point, Town, Turn
from tests.command import run
from tests.docs.pages import ROOT, environment

EXAMPLES = ROOT / "examples" / "traffic"
SEEDS = range(20) if os.environ.get("DYKNOW_FULL") else range(1)
CARS, SECONDS = 5, 60.0
IN = {"left": "turn_left_in", "right": "turn_right_in", "straight": "straight_through", "back": "turn_back_in"}
UNITS = """
from pathlib import Path
from dyknow.anchoring.roads.files.formats import read_roads
from dyknow.anchoring.traffic.units import road_units
UNITS = road_units(read_roads((Path(__file__).parent / "map").read_bytes()))
"""


def turns_alone(roads: RoadNetwork, *, in_degrees: bool) -> str:
    """The specification of traffic monitoring up to its chronicles of turns, each of them as a stream."""
    text = (EXAMPLES / "monitoring.kpl").read_text("utf-8")
    if in_degrees and roads.frame is not None:
        text = text.replace("x_m in m, y_m in m, on_road", "latitude_deg in deg, longitude_deg in deg, on_road")
        place = roads.frame.latitude_deg, roads.frame.longitude_deg
        text = "define ORIGIN_LATITUDE_DEG = {:.7f}\ndefine ORIGIN_LONGITUDE_DEG = {:.7f}\n".format(*place) + text
    begun = text[: text.index("stream turns_left")]
    found = ((f"{kind}{way}", f"{name}_crossing{way}") for kind, name in IN.items() for way in ("", "_predicted"))
    return begun + "".join(f"stream {stream} = chronicle[{chronicle}]\n" for stream, chronicle in found)


def recognised(
    folder: Path, text: str, seen: list[tuple[int, str, Point]], place: Callable[[Point], Point] | None = None
) -> set[Turn]:
    """The turns, with the names of the town for roads and crossings; on OpenStreetMap cars are seen in degrees."""
    roads = read_roads(text)
    in_degrees = format_of(text) == OPENSTREETMAP
    place = place or placing(text, roads)
    (folder / "map").write_text(text, "utf-8")
    (folder / "map.py").write_text(UNITS, "utf-8")
    (folder / "turns.kpl").write_text(turns_alone(roads, in_degrees=in_degrees), "utf-8")
    shutil.copy(EXAMPLES / "turns.chr", folder)
    with (folder / "feed.jsonl").open("w") as feed:
        for t_ms, car, at in seen:
            one, other = (round(each, 7 if in_degrees else 3) for each in place(at))
            feed.write(json.dumps({"t_ms": t_ms, "tracker": [car, one, other, True]}) + "\n")
    call = ["kpl", "run", "turns.kpl", "--units", "map.py", "--feed", "feed.jsonl", "--json"]
    done = run(call, environment(folder), folder)
    assert done.returncode == 0, done.stderr
    assert "names no object" not in done.stderr
    named = own_names(roads)
    found = set()
    for line in map(json.loads, done.stdout.splitlines()):
        if line["event"] == "sample":
            arguments = dict(line["value"][1])
            names = (named[arguments[each]] for each in ("?l1", "?x", "?l2"))
            found.add(Turn(arguments["?c"], line["stream"].partition("_")[0], *names))
    return found


def placing(text: str, roads: RoadNetwork) -> Callable[[Point], Point]:
    """From x and y of the town to those of a map, or to degrees."""
    name = format_of(text)
    if name == SUMO:
        return lambda at: (at[0] + SUMO_SHIFT[0], at[1] + SUMO_SHIFT[1])
    assert roads.frame is not None
    return lambda at: ORIGIN.from_ned(at[1], at[0], 0.0)[:2] if name == OPENSTREETMAP else at


def own_names(roads: RoadNetwork) -> dict[str, str]:
    """Names in specifications to those of the town: a road is known by its ends."""
    named = {roads.names[crossing]: crossing for crossing in roads.crossings}
    for link in roads.links.values():
        named[roads.names[link.id]] = f"r{'_'.join(sorted(filter(None, (link.start, link.end))))}"
    return named


def by_ends(turn: Turn) -> Turn:
    before, after = (f"r{'_'.join(sorted(each[1:].split('_')))}" for each in (turn.before, turn.after))
    return turn._replace(car=turn.car.replace("v", "co"), before=before, after=after)


@pytest.mark.parametrize("seed", SEEDS)
def test_turns_are_the_same_on_geojson_openstreetmap_and_sumo(seed: int, tmp_path: Path) -> None:
    town = Town(seed)
    maps = {GEOJSON: town.geojson(), OPENSTREETMAP: town.openstreetmap(), SUMO: town.sumo()}
    assert {name: format_of(text) for name, text in maps.items()} == {name: name for name in maps}
    assert '"-r' in maps[SUMO], "ways back have the name with -"
    assert any("." in link for link in read_roads(maps[OPENSTREETMAP]).links), "streets are cut where they meet"
    seen, made, last = town.drives(CARS, SECONDS)
    truth, at_the_end = {by_ends(turn) for turn in made}, {by_ends(turn) for turn in last}
    assert len(truth) >= 2 * CARS
    found = {}
    for name, text in maps.items():
        folder = tmp_path / name
        folder.mkdir()
        found[name] = recognised(folder, text, seen) - (at_the_end - truth)
    assert found == dict.fromkeys(maps, truth)


def test_turns_are_right_on_a_network_as_netconvert_writes_it_of_openstreetmap(tmp_path: Path) -> None:
    """`netconvert --osm-files` of SUMO 1.28 made town0.net.xml of the streets of seed 0: ids as `-4712#1`, a projection of its own."""
    town = Town(0)
    text = (Path(__file__).parent / "town0.net.xml").read_text("utf-8")
    roads = read_roads(text)
    assert any(link.startswith("-") and "#" in link for link in roads.links)
    ours = np.array([[*at, 1.0] for at in town.crossings.values()])
    theirs = np.array([roads.crossings[str(n)][1:3] for n in town.crossings])
    turned = np.linalg.lstsq(ours, theirs, rcond=None)[0]
    assert np.abs(ours @ turned - theirs).max() < 0.02
    seen, made, last = town.drives(CARS, SECONDS)
    truth, at_the_end = {by_ends(turn) for turn in made}, {by_ends(turn) for turn in last}
    found = recognised(tmp_path, text, seen, lambda at: tuple((np.array([*at, 1.0]) @ turned).tolist()))
    assert len(truth) >= 2 * CARS
    assert found - (at_the_end - truth) == truth


@pytest.mark.parametrize("seed", range(10))
def test_the_same_turns_can_be_recognised_on_each_of_the_maps(seed: int) -> None:
    """SUMO has a link for each direction, and says no less."""
    town = Town(seed)
    texts = (town.geojson(), town.openstreetmap(), town.sumo())
    summaries = [summary_of(read_roads(text)) for text in texts]
    assert {(each.left, each.right, each.straight, each.forks, each.ways) for each in summaries} == {
        (summaries[0].left, summaries[0].right, summaries[0].straight, summaries[0].forks, summaries[0].ways)
    }
    assert all(each.hidden_turns == 0 and each.turns > 20 for each in summaries)
