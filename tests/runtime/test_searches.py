"""Searches for plans in processes of their own: answered by an event, ended when they are wanted no more, bounded in time."""

import os
import pickle
from base64 import b64encode
from collections.abc import Callable
from functools import partial
from pathlib import Path
from queue import Empty, SimpleQueue

import pytest

from dyknow.agents.capabilities.missions.mission_texts import read_mission, texts_in
from dyknow.agents.effects import EndSearch, RunSearch, SearchNews, SearchOver
from dyknow.runtime.searches.workers import MOST, SearchWorkers

EXAMPLES = Path(__file__).parents[2] / "examples" / "missions"
DOMAIN, PROBLEM = ((EXAMPLES / name).read_text("utf-8") for name in ("survey.dom", "one.prob"))
PATIENCE_S = 60.0
HARD = """
#domain box
#feature up(box) : boolean
#operator lift(box) :precond [start] !up(box) :effects [end] up(box)
#operator drop(box) :precond [start] up(box) :effects [end] !up(box)
#objects box = b1 .. b22
#goal never: exists box: up(box) & !up(box)
"""


def over(posted: SimpleQueue[SearchNews | SearchOver]) -> SearchOver:
    while True:
        event = posted.get(timeout=PATIENCE_S)
        if isinstance(event, SearchOver):
            return event


def test_a_search_comes_back_as_an_event_gives_up_in_time_and_is_silent_once_it_is_ended() -> None:
    posted: SimpleQueue[SearchNews | SearchOver] = SimpleQueue()
    workers = SearchWorkers(posted.put, lambda: 7)
    try:
        workers.perform(RunSearch(1, DOMAIN, PROBLEM, None, 30_000_000))
        found = over(posted)
        assert (found.at_us, found.number, found.reason) == (7, 1, "")
        assert found.plan is not None
        assert [row[3] for row in found.plan["actions"]][-1] == "land(uav0)"
        workers.perform(RunSearch(2, HARD, "", None, 300_000))
        gave_up = over(posted)
        assert (gave_up.number, gave_up.plan, gave_up.is_certain) == (2, None, False)
        assert "gave up after" in gave_up.reason
        workers.perform(RunSearch(3, HARD, "", None, 30_000_000))
        workers.perform(EndSearch(3))
        workers.perform(RunSearch(4, "#domain", "", None, 1_000_000))
        wrong = over(posted)
        assert (wrong.number, wrong.plan) == (4, None)
        with pytest.raises(Empty):
            posted.get(timeout=0.2)
    finally:
        workers.close()


def test_texts_are_read_there_and_mistakes_keep_their_place_and_cause() -> None:
    posted: SimpleQueue[SearchNews | SearchOver] = SimpleQueue()
    workers, given = SearchWorkers(posted.put, lambda: 7), {"constraints": "", "actions": [], "is_whole": False}
    try:
        for number, problem in enumerate((PROBLEM, "#objects uav = {uav0} #goal flown(uav0)", "#objects place = {a}")):
            reading = given | {"domain": DOMAIN, "problem": problem, "platforms": {}}
            workers.perform(RunSearch(number, "", "", None, 30_000_000, None, reading))
            found = over(posted).plan
            assert found is not None
            if number == 0:
                texts = texts_in(found)
                assert texts == read_mission(DOMAIN, PROBLEM, "", (), is_whole=False, platforms={})
                assert texts.platforms == {"uav0": "0"}
            elif number == 1:
                assert found["wrong"].startswith("1:29: there is no feature flown") and found["code"] is None
            else:
                assert found["code"] == "no-unit"
    finally:
        workers.close()


class Bomb:
    def __init__(self, effect: Callable[..., object], *given: object) -> None:
        self.effect, self.given = effect, given

    def __reduce__(self) -> tuple[Callable[..., object], tuple[object, ...]]:
        return self.effect, self.given


@pytest.mark.parametrize(
    "bomb", [Bomb(os.mkdir, "bombed"), Bomb(eval, "__import__('os').mkdir('bombed')"), Bomb(partial)]
)
def test_what_no_process_of_the_platform_wrote_runs_nothing(
    bomb: Bomb, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match="cannot be read"):
        texts_in({"texts": b64encode(pickle.dumps(bomb)).decode()})
    assert not (tmp_path / "bombed").exists()


@pytest.mark.parametrize("texts", ["", "gibberish", None, 7, b64encode(pickle.dumps(7)).decode()])
def test_what_is_no_texts_is_told(texts: object) -> None:
    with pytest.raises(ValueError, match="what was packed"):
        texts_in({"texts": texts})


def test_more_searches_than_run_at_a_time_are_refused_at_once() -> None:
    posted: SimpleQueue[SearchNews | SearchOver] = SimpleQueue()
    workers = SearchWorkers(posted.put, lambda: 7)
    try:
        for number in range(MOST + 1):
            workers.perform(RunSearch(number, HARD, "", None, 30_000_000))
        refused = over(posted)
        assert (refused.number, refused.plan) == (MOST, None)
        assert f"{MOST} searches" in refused.reason
    finally:
        workers.close()
