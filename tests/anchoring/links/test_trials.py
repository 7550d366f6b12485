"""Links on trial: what appears where a known object is expected, and moves another way, is another."""

from dyknow.anchoring.links.beginnings import ObjectBeginnings
from dyknow.anchoring.links.objects import LinkEvent
from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.links.structures import ObjectLinkage, Percept, StateRecord
from dyknow.anchoring.ready import VISION, WORLD, ready_specification
from tests.anchoring.links import invariants

STEP_MS = 100


def passed(speed_m_s: float) -> tuple[list[LinkEvent], list[StateRecord], ObjectLinkage]:
    """vp1 drives east at 10 m/s until it is hidden at 3 s; where it is expected at 4 s vp2 appears, with this speed."""
    specifications = ready_specification()
    linkage, events, states = ObjectLinkage(specifications), list[LinkEvent](), list[StateRecord]()
    beginnings = ObjectBeginnings(linkage, specifications)
    for t_ms in range(0, 7000, STEP_MS):
        x_m = t_ms / 100 if t_ms <= 3000 else 40.0 + speed_m_s * (t_ms - 4000) / 1000
        name = "vp1" if t_ms <= 3000 else "vp2"
        state = ObjectState(t_ms * 1000, x_m, 0.0, 0.0, 0.0, diagonal(0.3))
        far = ObjectState(t_ms * 1000, 500.0, 500.0, 0.0, 0.0, diagonal(0.3))
        shown = [Percept("far", VISION, far)]
        percepts = shown if 3000 < t_ms < 4000 else [Percept(name, VISION, state), *shown]
        outcome = linkage.on_percepts(t_ms * 1000, percepts)
        invariants.check(linkage, outcome)
        outcome = beginnings.completed(percepts, outcome)
        events += [each for each in outcome.events if each.source == "vp2"]
        states += outcome.states
    return events, states, linkage


def test_what_moves_on_as_it_did_stays_linked() -> None:
    events, _, linkage = passed(10.0)
    assert [(each.kind, each.target) for each in events] == [("reestablished", "wo2")]
    assert not any(process.trials.by_source for process in linkage.into[WORLD])


def test_what_moves_the_other_way_is_another_and_has_its_states_since_it_was_seen() -> None:
    events, states, linkage = passed(-10.0)
    assert [(each.kind, each.target) for each in events] == [
        ("reestablished", "wo2"),
        ("unlinked", "wo2"),
        ("established", "wo3"),
    ]
    assert events[1].reason.cause == "another"
    assert events[1].valid_us <= 5_000_000
    assert events[2].valid_us <= 5_500_000
    assert sorted(each.valid_us // 1000 for each in states if each.symbol == "wo3") == list(range(4000, 7000, STEP_MS))
    known = linkage.find("wo2")
    assert known is not None
    assert known.observed[-1].valid_us == 3_000_000
