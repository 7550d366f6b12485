"""The scores of `python -m bench.linkage`: what is perfect scores 1, and the quick figure is the one of py-motmetrics."""

import numpy as np
import pytest

from bench.linkage.__main__ import BARS, GAP
from bench.linkage.ours import by_links
from bench.linkage.peers import GRID, by_norfair, per_percept
from bench.linkage.scores import Shown, Track, mean, quick_idf1, score
from dyknow.sim_uavs.roads.scenes import SCENES, RoadRecording, recorded


def perfect(recording: RoadRecording) -> list[Track]:
    tracks: list[Track] = []
    known: set[str] = set()
    for look in recording.looks:
        visible = {percept.of for percept in look.percepts if percept.of and not percept.end}
        known |= visible
        tracks.append({s.name: Shown(s.x_m, s.y_m, s.name in visible) for s in look.truth if s.name in known})
    return tracks


def test_the_truth_scores_one_and_bridges_every_gap() -> None:
    recording = recorded("two", 1)
    assert score(recording.looks, perfect(recording)) == (1.0, 1.0, 0.0, 1.0, 2.0)


def test_two_cars_that_exchange_their_symbols_are_two_switches() -> None:
    recording = recorded("two", 1)
    names = {"car1": "car2", "car2": "car1"}
    tracks = [
        track if n < 120 else {names[name]: shown for name, shown in track.items()}
        for n, track in enumerate(perfect(recording))
    ]
    found = score(recording.looks, tracks)
    assert found.switches == 2
    assert 0.4 < found.idf1 < 0.7


def test_what_is_predicted_elsewhere_bridges_no_gap() -> None:
    recording = recorded("one", 1)
    tracks = [
        {name: shown if shown.seen else shown._replace(x_m=shown.x_m + 15.1) for name, shown in track.items()}
        for track in perfect(recording)
    ]
    found = score(recording.looks, tracks)
    assert (found.idf1, found.gap) == (1.0, 0.0)
    assert found.idf1_all < 0.9


def test_a_new_object_per_percept_is_a_new_symbol_after_every_gap() -> None:
    recording = recorded("one", 1)
    found = score(recording.looks, per_percept(recording.looks))
    assert found.idf1 == pytest.approx(0.25, abs=0.02)
    assert (found.switches, found.gap, found.objects) == (3.0, 0.0, 4.0)


@pytest.mark.parametrize("name", ["two", "clutter"])
def test_the_quick_figure_is_that_of_py_motmetrics(name: str) -> None:
    recording = recorded(name, 1)
    looks = recording.looks[:120]
    rng = np.random.default_rng(5)
    for tracks in (
        per_percept(looks),
        by_norfair(looks, GRID[10]),
        [{f"o{rng.integers(3)}": shown for shown in track.values()} for track in per_percept(looks)],
    ):
        assert quick_idf1(looks, tracks) == pytest.approx(score(looks, tracks).idf1, abs=1e-9)


def check_bars(name: str, seeds: range) -> None:
    """IDF1 over the seeds at its bar; one car: no switch and gaps bridged; no object of clutter."""
    recordings = [recorded(name, seed) for seed in seeds]
    linked = [by_links(recording) for recording in recordings]
    found = mean([score(each.looks, one.tracks) for each, one in zip(recordings, linked, strict=True)])
    assert found.idf1 >= BARS[name]
    assert not sum(one.from_clutter(each) for each, one in zip(recordings, linked, strict=True))
    if name == "one":
        assert (found.switches, found.objects) == (0.0, 1.0)
        assert found.gap >= GAP


@pytest.mark.parametrize("name", ["one", "noise", "two", "slow"])
def test_the_symbols_of_the_command_are_at_their_bars(name: str) -> None:
    check_bars(name, range(1, 2))


@pytest.mark.full
@pytest.mark.parametrize("name", SCENES)
def test_the_symbols_of_the_command_are_at_their_bars_in_every_scene(name: str) -> None:
    check_bars(name, range(1, 11))
