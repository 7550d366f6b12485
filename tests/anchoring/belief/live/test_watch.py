"""Looks of several sources become beliefs: what is in view and not seen fades, sources that contradict are trusted less."""

from collections.abc import Iterable

import numpy as np
import pytest

from dyknow.anchoring.belief.description import WorldModel
from dyknow.anchoring.belief.live.gathering import MOST_WAITING, PATIENCE_US, LookGatherer, SourceLook
from dyknow.anchoring.belief.live.records import BELIEF_SORT, BeliefRecords, quality_of
from dyknow.anchoring.belief.live.watch import MOST_REPORTED, ObservingSource, ReportedBelief, WorldWatch
from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.links.structures import Percept
from tests.anchoring.belief.worlds import S, position, sensor, world

LOOK_US = 100_000
WHOLE = np.array([[-50.0, -50.0], [50.0, -50.0], [50.0, 50.0], [-50.0, 50.0]])
WEST = np.array([[-50.0, -50.0], [0.0, -50.0], [0.0, 50.0], [-50.0, 50.0]])


def model(**about: float) -> WorldModel:
    camera = sensor(**{"detects": 0.8, "births": 0.3, "clutter": 0.3, **about})
    return world(camera, place=position(2, 0.5), kept_per_s=0.95)


def percept(name: str, x_m: float, y_m: float, at_us: int, **attributes: str) -> Percept:
    return Percept(name, "vp", ObjectState(at_us, x_m, y_m, 0.0, 0.0, diagonal(0.5), attributes))


class Watched:
    """A watch of some sources, and what it reports."""

    def __init__(self, *trusts: float, of: WorldModel | None = None) -> None:
        sources = [ObservingSource(str(at), "camera", trust) for at, trust in enumerate(trusts or (1.0,))]
        self.watch = WorldWatch(of or model(), (), sources)
        self.now_us = 0
        self.reported: list[ReportedBelief] = []

    def look(
        self, *places: tuple[float, float], source: int = 0, view: np.ndarray | None = WHOLE, **attributes: str
    ) -> list[ReportedBelief]:
        self.now_us += LOOK_US
        percepts = [percept(f"vp{at}", *place, self.now_us, **attributes) for at, place in enumerate(places)]
        self.reported = self.watch.on_look(SourceLook(self.now_us, source, percepts, view))
        return self.reported

    @property
    def existence(self) -> dict[str, float]:
        table = self.watch.environment.table
        return dict(zip(table.names, table.existence.tolist(), strict=True))


def test_what_is_in_view_and_not_seen_fades_and_what_is_outside_does_not() -> None:
    watched = Watched()
    for _ in range(10):
        watched.look((-20.0, 0.0), (20.0, 0.0), colour="red")
    inside, outside = watched.existence
    for _ in range(2):
        watched.look(view=WEST)
    assert watched.existence[inside] < 0.995
    assert watched.existence[outside] > 0.9999 - 0.02
    for _ in range(4):
        watched.look(view=WEST)
    assert inside not in watched.existence
    assert watched.existence[outside] > 0.95


def test_what_is_given_up_is_reported_once_as_ended_and_its_name_never_again() -> None:
    watched = Watched()
    for _ in range(5):
        watched.look((0.0, 0.0))
    (name,) = watched.existence
    ended = [each for _ in range(12) for each in watched.look() if each.ended]
    assert [each.instance.name for each in ended] == [name]
    watched.look((0.0, 0.0))
    assert name not in watched.existence


def test_a_belief_names_the_sources_that_saw_it_lately() -> None:
    watched = Watched(1.0, 1.0)
    for source in (0, 1, 0, 1, 0):
        watched.look((0.0, 0.0), source=source)
    assert watched.reported[0].seen_by == ("0", "1")
    watched.now_us += 6 * S
    watched.look((0.0, 0.0), source=1)
    watched.look((0.0, 0.0), source=1)
    assert watched.reported[0].seen_by == ("1",)


def test_a_source_that_misses_what_others_see_is_trusted_less_with_the_reason_and_earns_trust_again() -> None:
    watched = Watched(1.0, 1.0)
    for _ in range(30):
        watched.look((0.0, 0.0), (10.0, 10.0), (-10.0, 10.0), source=0)
        watched.look(source=1)
    sound, blind = watched.watch.trust
    assert blind.value < 0.5
    assert sound.value > 0.8
    assert "found 0 where" in blind.because
    (event, *_) = watched.watch.explain("1")
    assert (event.kind, event.existence < 0.91) == ("trust", True)
    for _ in range(300):
        watched.look((0.0, 0.0), (10.0, 10.0), (-10.0, 10.0), source=0)
        watched.look((0.0, 0.0), (10.0, 10.0), (-10.0, 10.0), source=1)
    assert watched.watch.trust[1].value > 2.0 * blind.value


def test_a_source_that_reports_what_nothing_confirms_is_trusted_less() -> None:
    rng = np.random.default_rng(5)
    watched = Watched(1.0, 1.0)
    for _ in range(60):
        watched.look((0.0, 0.0), source=0)
        watched.look((0.0, 0.0), *rng.uniform(-50.0, 50.0, (5, 2)).tolist(), source=1)
    assert watched.watch.trust[1].value < 0.8 < watched.watch.trust[0].value
    assert "never confirmed" in watched.watch.trust[1].because


def test_a_source_that_is_not_trusted_neither_makes_nor_ends_anything() -> None:
    watched = Watched(1.0, 0.0)
    for _ in range(5):
        watched.look((0.0, 0.0))
    (name,) = watched.existence
    before = watched.existence[name]
    for _ in range(20):
        watched.look((30.0, 30.0), source=1)
    assert list(watched.existence) == [name]
    assert watched.existence[name] > before - 0.12  # time alone


def test_two_sources_that_disagree_are_weighed_by_how_far_they_are_trusted() -> None:
    def of_a_disagreement(*trusts: float) -> float:
        watched = Watched(*trusts)
        for _ in range(4):
            watched.look((0.0, 0.0), source=0)
        for _ in range(2):
            watched.look(source=1)
        return max(watched.existence.values(), default=0.0)

    assert of_a_disagreement(1.0, 0.2) > of_a_disagreement(1.0, 1.0)


def test_ten_thousand_instances_are_bounded_work_and_what_waits_is_counted() -> None:
    rng = np.random.default_rng(1)
    side = np.linspace(-490.0, 490.0, 100)
    nowhere = WHOLE + 10_000.0
    wide = world(sensor(births=1.0, clutter=0.1), place=position(2, 0.5, 1000.0), kept_per_s=0.99)
    watched = Watched(of=wide)
    grid = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    for rows in np.split(rng.permutation(grid), 10):
        watched.look(*rows.tolist(), view=nowhere)
    assert len(watched.existence) > 9_000
    assert all(len(watched.look((0.0, 0.0), view=WEST)) <= MOST_REPORTED for _ in range(3))
    assert watched.watch.counts["beliefs that were reported later"] > 1_000


def test_records_have_what_their_sort_has_fields_for_and_are_as_certain_as_the_instance() -> None:
    watched = Watched()
    for _ in range(3):
        reported = watched.look((3.0, 4.0), colour="red")
    BELIEF_SORT.check(BeliefRecords(BELIEF_SORT, None).value(reported[0]))
    record = BELIEF_SORT.as_record(BeliefRecords(BELIEF_SORT, None).value(reported[0]))
    assert (record["status"], record["types"]) == ("confirmed", "car 0.50, pedestrian 0.50")
    assert (record["x_m"], record["colour"], record["end"]) == (pytest.approx(3.0, abs=0.5), "red", False)
    assert quality_of(reported[0]).certainty == record["existence"]


# -- looks ------------------------------------------------------------------------------------------------------------


def seen(gatherer: LookGatherer, now_us: int) -> Iterable[tuple[int, int, int]]:
    return [(look.valid_us, look.source, len(look.percepts)) for look in gatherer.ready(now_us)]


def test_the_look_of_the_own_source_is_complete_at_once() -> None:
    gatherer = LookGatherer([True])
    gatherer.on_view(0, 100, WHOLE, 150)
    assert seen(gatherer, 150) == [(100, 0, 0)]
    gatherer.on_percept(0, 200, percept("a", 0.0, 0.0, 200), 250)
    (look,) = gatherer.ready(250)
    assert look.view_m is WHOLE  # the view of shortly before counts
    gatherer.on_percept(0, 200, percept("b", 0.0, 0.0, 200), 260)
    assert not gatherer.ready(300)
    assert gatherer.left_out["reports of a time that is over"] == 1


def test_looks_of_several_sources_come_in_the_order_of_time_whatever_their_delays() -> None:
    gatherer = LookGatherer([True, False])
    for at in (100, 200, 300):
        gatherer.on_view(0, at, WHOLE, at)
    assert not gatherer.ready(300)
    gatherer.on_percept(1, 150, percept("a", 0.0, 0.0, 150), 310)
    gatherer.on_percept(1, 250, percept("a", 0.0, 0.0, 250), 350)
    assert seen(gatherer, 350) == [(100, 0, 0), (150, 1, 1), (200, 0, 0)]
    assert seen(gatherer, 350 + PATIENCE_US) == [(250, 1, 1), (300, 0, 0)]


def test_a_flood_of_looks_of_one_source_does_not_wait_for_the_other_for_ever() -> None:
    gatherer = LookGatherer([True, False])
    taken = 0
    for at in range(1, 3 * MOST_WAITING):
        gatherer.on_view(0, at, WHOLE, 0)
        taken += len(gatherer.ready(0))
    assert taken > MOST_WAITING
