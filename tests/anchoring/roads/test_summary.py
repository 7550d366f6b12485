"""What `roads check` says can be recognised on a map."""

from hypothesis import given
from hypothesis import strategies as st

from dyknow.anchoring.roads.files.formats import read_roads
from dyknow.anchoring.roads.files.summary import summary_of
from tests.anchoring.roads.towns import cross, crossing, link, text


def test_turns_forks_and_ways_of_a_crossing_are_counted() -> None:
    found = summary_of(read_roads(cross()))
    assert (found.turns, found.left, found.right, found.straight, found.back) == (16, 4, 4, 4, 4)
    assert (found.forks, found.ways, found.both_ways, found.hidden_turns) == (4, 8, 4, 0)
    assert found.warnings() == ()


def test_a_street_alone_has_no_turn_and_that_is_a_warning() -> None:
    found = summary_of(read_roads(text(link("l", None, None, [(0, 0), (90, 0)], oneway=True))))
    assert (found.turns, found.forks, found.ways, found.both_ways) == (0, 0, 1, 0)
    (warning,) = found.warnings()
    assert (
        warning.drawn
        == "no turn can be recognised on it: no link leads to another; name the crossings where links meet"
    )


@given(gap_m=st.floats(16.5, 60.0), speed_m_s=st.floats(2.0, 40.0))
def test_turns_of_a_link_that_is_passed_in_less_than_half_a_second_are_hidden(gap_m: float, speed_m_s: float) -> None:
    """Two crossings of 8 m; a link is left at 1.2 radii of the first, and ends at the radius of the second."""
    found = summary_of(
        read_roads(
            text(
                crossing("a", 0, 0, 8),
                crossing("b", gap_m, 0, 8),
                link("in", None, "a", [(-99, 0), (0, 0)], oneway=True),
                link("short", "a", "b", [(0, 0), (gap_m, 0)], oneway=True, speed_m_s=speed_m_s),
                link("out", "b", None, [(gap_m, 0), (gap_m, 99)], oneway=True),
            )
        )
    )
    is_hidden = gap_m - 1.2 * 8 - 8 < 0.5 * speed_m_s
    assert (found.turns, found.hidden_turns) == ((0, 2) if is_hidden else (2, 0))
    assert found.hidden_links == (("short",) if is_hidden else ())
    assert len(found.warnings()) == is_hidden
    if is_hidden:
        assert "2 of 2 turns cannot be recognised: a car is on 'short'" in found.warnings()[0].message
