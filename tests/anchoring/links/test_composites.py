"""Composite objects: groups of parts under one symbol, anchored through their parts."""

import pytest

from dyknow.anchoring.links.composites import CompositeSpecification
from dyknow.anchoring.links.objects import LinkEvent, LinkObject
from dyknow.anchoring.links.specification import LinkSpecification
from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.links.structures import ObjectLinkage, Percept
from dyknow.anchoring.ready import NEAR, NEW, VISION, WORLD, ready_specification
from dyknow.kpl import parse_formula
from tests.anchoring.links import invariants

CONVOY = CompositeSpecification(
    WORLD, "convoy",
    parse_formula("always [0, 2000] (xy_dist[from, to] < 30 and abs(speed[from] - speed[to]) < 3)"),
    parse_formula("always eventually [0, 2000] xy_dist[from, to] < 40"),
)  # fmt: skip


class Road:
    """Cars on one line, by their position at a time, and the convoys among them."""

    def __init__(self, *more: CompositeSpecification | LinkSpecification) -> None:
        self.linkage = ObjectLinkage([*ready_specification(), *(more or (CONVOY,))])
        self.events: list[tuple[str, str, str]] = []
        self.all_events: list[LinkEvent] = []

    def drive(self, from_s: int, to_s: int, **cars: tuple[float, float]) -> None:
        """Each with where it is at second 0, and its speed."""
        for t_us in range(from_s * 1_000_000, to_s * 1_000_000, 200_000):
            percepts = [
                Percept(name, VISION, ObjectState(t_us, x + speed * t_us / 1e6, 0.0, speed, 0.0, diagonal(0.3, 0.5)))
                for name, (x, speed) in cars.items()
            ]
            outcome = self.linkage.on_percepts(t_us, percepts)
            self.all_events += outcome.events
            self.events += [(one.kind, one.source, one.target) for one in outcome.events if one.target_type == "convoy"]

    def convoy(self) -> LinkObject:
        """The only one."""
        (found,) = self.linkage.objects("convoy").values()
        return found


def test_cars_that_drive_close_together_for_a_while_are_a_convoy_and_another_is_not() -> None:
    road = Road()
    road.drive(0, 6, a=(0.0, 10.0), b=(20.0, 10.0), c=(40.0, 10.0), d=(500.0, 10.0), e=(-20.0, 30.0))
    convoy = road.convoy()
    assert convoy.state.attributes == {"parts": "wo1 wo2 wo3", "count": 3}
    assert road.linkage.anchored("convoy1")
    assert abs(convoy.state.x_m - 20.0 - 10.0 * convoy.state.valid_us / 1e6) < 1.0
    assert road.events == [("established", name, "convoy1") for name in ("wo1", "wo2", "wo3")]
    assert all(each.reason.explanations for each in road.linkage.explain("convoy1")), "with the samples that decided it"


def test_a_part_that_falls_back_leaves_and_the_symbol_stays() -> None:
    road = Road()
    cars = {"a": (0.0, 10.0), "b": (20.0, 10.0), "c": (40.0, 10.0)}
    road.drive(0, 6, **cars)
    road.drive(6, 20, **{**cars, "a": (36.0, 4.0)})
    convoy = road.convoy()
    assert convoy.symbol == "convoy1"
    assert set(convoy.incoming) == {"wo2", "wo3"}
    assert ("unlinked", "wo1", "convoy1") in road.events
    (left,) = (each for each in road.linkage.explain("convoy1") if each.kind == "unlinked")
    assert left.reason.explanations


def test_it_is_anchored_through_any_part_and_forgotten_with_them() -> None:
    road = Road()
    road.drive(0, 6, a=(0.0, 10.0), b=(20.0, 10.0))
    road.drive(6, 10, b=(20.0, 10.0))
    assert set(road.convoy().incoming) == {"wo1", "wo2"}
    assert road.linkage.anchored("convoy1")
    road.drive(10, 80, other=(-9000.0, 0.0))
    assert not road.linkage.objects("convoy")
    assert not road.linkage.anchored("convoy1")
    assert road.events[-1] == ("forgotten", "", "convoy1")


def test_a_part_that_is_given_another_symbol_stays_one() -> None:
    road = Road()
    road.drive(0, 6, a=(0.0, 10.0), b=(20.0, 10.0))
    road.linkage.want("mine", WORLD, parse_formula("x[from] < 70"))
    road.drive(6, 12, a=(0.0, 10.0), b=(20.0, 10.0))
    assert set(road.convoy().incoming) == {"mine", "wo2"}
    assert not [each for each in road.events if each[0] == "unlinked"]


COLUMN = LinkSpecification(
    "convoy", "column", parse_formula("eventually[1000, oo] true"),
    parse_formula("eventually[0, 2000] xy_dist[from, to] < 60"), unit=lambda state, _before: state,
)  # fmt: skip


def test_a_composite_is_linked_to_an_object_that_outlives_it() -> None:
    road = Road(CONVOY, COLUMN)
    cars = {"a": (0.0, 10.0), "b": (20.0, 10.0)}
    road.drive(0, 6, **cars)
    (column,) = road.linkage.objects("column").values()
    assert column.state.attributes["parts"] == "wo1 wo2"
    assert road.linkage.anchored(column.symbol)
    road.drive(6, 20, **{**cars, "a": (36.0, 4.0)})
    assert not road.linkage.objects("convoy")
    assert not road.linkage.anchored(column.symbol)
    assert column.prediction is not None, "it is predicted as any object is"
    road.drive(20, 27, a=(-96.0, 10.0 + 0.6), b=(20.0 - 100.0, 10.0))
    (again,) = road.linkage.objects("convoy")
    assert again == "convoy2"
    made = [each for each in road.all_events if each.target_type == "column"]
    assert [each.kind for each in made][:2] == ["established", "unlinked"]
    road.drive(27, 75, other=(-9000.0, 0.0))
    assert not road.linkage.objects("column"), "forgotten as any object is"


def test_a_convoy_is_looked_for_by_what_it_is_and_has_the_symbol_while_it_lasts() -> None:
    road = Road(CONVOY, COLUMN)
    road.linkage.want("presidents", "convoy", parse_formula("count[from] >= 3 and speed[from] < 20"))
    cars = {"a": (0.0, 10.0), "b": (20.0, 10.0)}
    road.drive(0, 6, **cars)
    assert road.linkage.wanted == ("presidents",)
    road.drive(6, 12, **cars, c=(40.0, 10.0))
    assert road.convoy().symbol == "presidents"
    (found,) = (each for each in road.all_events if each.kind == "find")
    assert (found.source, found.target, found.target_type) == ("", "presidents", "convoy")
    (column,) = road.linkage.objects("column").values()
    assert {link.source.symbol for link in column.incoming.values()} == {"presidents"}
    road.drive(12, 40, a=(0.0, 10.0), b=(-400.0, 10.0), c=(900.0, 10.0))
    kinds = [each.kind for each in road.all_events if each.target == "presidents"]
    assert kinds[kinds.index("find") :][:2] == ["find", "track"]
    assert kinds[-1] == "lost"
    assert road.linkage.wanted == ("presidents",), "and is looked for again"
    road.linkage.unwant("presidents")
    with pytest.raises(ValueError, match="no link leads to the type 'fleet'; there are world, column, convoy"):
        road.linkage.want("it", "fleet", parse_formula("count[from] > 1"))


def test_a_wanted_convoy_that_is_wanted_no_more_has_a_symbol_of_its_own() -> None:
    road = Road()
    road.linkage.want("mine", "convoy", parse_formula("count[from] = 2"))
    road.drive(0, 6, a=(0.0, 10.0), b=(20.0, 10.0))
    assert road.convoy().symbol == "mine"
    road.linkage.unwant("mine")
    road.drive(6, 8, a=(0.0, 10.0), b=(20.0, 10.0))
    assert road.convoy().symbol == "convoy2"


def test_composites_whose_parts_may_be_anywhere_or_that_are_linked_are_refused() -> None:
    with pytest.raises(ValueError, match="near each other"):
        Road(CompositeSpecification(WORLD, "convoy", parse_formula("speed[from] < 3")))
    with pytest.raises(ValueError, match="no link leads to them"):
        ObjectLinkage([*ready_specification(), CONVOY, LinkSpecification(VISION, "convoy", NEW, NEAR)])


def test_a_part_that_comes_again_under_its_name_is_another_part() -> None:
    """Percepts that are silent for longer than they may be end and begin in the same tick."""
    near = parse_formula("xy_dist[from, to] < 30")
    pair = CompositeSpecification(VISION, "convoy", near, near)
    linkage, made = ObjectLinkage([*ready_specification(), pair], silence_us=150_000), list[tuple[int, str]]()
    for t_us in (0, 100_000, 300_000, 400_000):
        percepts = [
            Percept(name, VISION, ObjectState(t_us, x_m, 0.0, 0.0, 0.0, diagonal(0.3)))
            for name, x_m in (("a", 0.0), ("b", 10.0))
        ]
        outcome = linkage.on_percepts(t_us, percepts)
        invariants.check(linkage, outcome)
        made += [
            (t_us, each.target)
            for each in outcome.events
            if each.target_type == "convoy" and each.kind == "established"
        ]
    assert made == [(0, "convoy1"), (0, "convoy1"), (300_000, "convoy2"), (300_000, "convoy2")]
