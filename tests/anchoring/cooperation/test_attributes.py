"""Values of attributes that are too many are left out and counted; what was not seen for a second begins anew."""

from dyknow import Label
from dyknow.anchoring.cooperation.attributes import MOST_HELD, UNSEEN_US, AttributeChanges, ObjectAttribute, Sights
from dyknow.anchoring.cooperation.manoeuvres import MOST_WAITING, SpanningManoeuvres
from dyknow.kpl import parse_chronicles

CHANGES = parse_chronicles(
    "attribute lane[?c]\nchronicle changes[?c, ?one, ?other](t) { event(lane[?c]:(?one, ?other), t) }\n"
)


def test_changes_that_wait_for_names_are_bounded_and_the_rest_is_counted() -> None:
    changes = AttributeChanges(0)
    for number in range(MOST_HELD + 3):
        changes.on_sample(Label("lane", (f"c{number}",)), number, "left")
        changes.on_sample(Label("lane", (f"c{number}",)), number, 3.5)
    assert changes.lost == 3
    assert len(changes.news([], "0", 10**9)) == MOST_HELD


def test_own_values_that_wait_to_be_recognised_are_bounded_and_that_is_said() -> None:
    spans = SpanningManoeuvres(CHANGES, "changes")
    taken = [
        spans.take_own(ObjectAttribute(Label("lane", ("c",)), f"l{number}", number, number))
        for number in range(MOST_WAITING + 2)
    ]
    assert taken == [True] * MOST_WAITING + [False] * 2


def test_what_is_not_seen_for_a_second_is_seen_since_it_is_seen_again() -> None:
    sights = Sights()
    sights.see({"a": 0})
    sights.see({"a": UNSEEN_US})
    assert (sights.since_us("a"), sights.has("a", 2 * UNSEEN_US), sights.has("a", 2 * UNSEEN_US + 1)) == (
        0,
        True,
        False,
    )
    sights.see({"a": 2 * UNSEEN_US + 1})
    assert sights.since_us("a") == 2 * UNSEEN_US + 1
