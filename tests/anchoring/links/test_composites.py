"""Composite objects: groups of parts under one symbol, anchored through their parts."""

from anchoring.links.composites import CompositeObjects, CompositeSpecification
from anchoring.links.states import ObjectState, diagonal
from anchoring.links.structures import ObjectLinkage, Percept
from anchoring.ready import VISION, WORLD, ready_specification
from kpl import parse_formula

CONVOY = CompositeSpecification(
    WORLD, "convoy",
    parse_formula("always [0, 2000] (xy_dist[from, to] < 30 and abs(speed[from] - speed[to]) < 3)"),
    parse_formula("always eventually [0, 2000] xy_dist[from, to] < 40"),
)  # fmt: skip


class Road:
    """Cars on one line, by their position at a time, and the convoys among them."""

    def __init__(self) -> None:
        self.linkage, self.convoys = ObjectLinkage(ready_specification()), CompositeObjects(CONVOY)
        self.events: list[tuple[str, str, str]] = []

    def drive(self, from_s: int, to_s: int, **cars: tuple[float, float]) -> None:
        """Each with where it is at second 0, and its speed."""
        for t_us in range(from_s * 1_000_000, to_s * 1_000_000, 200_000):
            percepts = [
                Percept(name, VISION, ObjectState(t_us, x + speed * t_us / 1e6, 0.0, speed, 0.0, diagonal(0.3, 0.5)))
                for name, (x, speed) in cars.items()
            ]
            self.linkage.on_percepts(t_us, percepts)
            found = self.convoys.step(t_us, self.linkage.objects(WORLD).values())
            self.events += [(each.kind, each.source, each.target) for each in found]


def test_cars_that_drive_close_together_for_a_while_are_a_convoy_and_another_is_not() -> None:
    road = Road()
    road.drive(0, 6, a=(0.0, 10.0), b=(20.0, 10.0), c=(40.0, 10.0), d=(500.0, 10.0), e=(-20.0, 30.0))
    (convoy,) = road.convoys.composites.values()
    assert set(convoy.parts) == {"wo1", "wo2", "wo3"}
    assert convoy.is_anchored
    assert abs(convoy.state.x_m - 20.0 - 10.0 * convoy.state.valid_us / 1e6) < 1.0
    assert road.events == [("established", name, "convoy1") for name in ("wo1", "wo2", "wo3")]


def test_a_part_that_falls_back_leaves_and_the_symbol_stays() -> None:
    road = Road()
    cars = {"a": (0.0, 10.0), "b": (20.0, 10.0), "c": (40.0, 10.0)}
    road.drive(0, 6, **cars)
    road.drive(6, 20, **{**cars, "a": (36.0, 4.0)})
    (convoy,) = road.convoys.composites.values()
    assert convoy.symbol == "convoy1"
    assert set(convoy.parts) == {"wo2", "wo3"}
    assert ("unlinked", "wo1", "convoy1") in road.events


def test_it_is_anchored_through_any_part_and_forgotten_with_them() -> None:
    road = Road()
    road.drive(0, 6, a=(0.0, 10.0), b=(20.0, 10.0))
    road.drive(6, 10, b=(20.0, 10.0))
    (convoy,) = road.convoys.composites.values()
    assert set(convoy.parts) == {"wo1", "wo2"}
    assert convoy.is_anchored
    road.drive(10, 80, other=(-9000.0, 0.0))
    assert not road.convoys.composites
    assert road.events[-1] == ("forgotten", "", "convoy1")
