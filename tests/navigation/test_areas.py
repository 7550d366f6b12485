import math

import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from dyknow.model.errors import Refused
from dyknow.navigation.areas import Area, Corner, Piece
from dyknow.navigation.geodesy import metres_per_degree

MIDDLE = (58.4, 15.5)


def plane(ring: tuple[Corner, ...] | list[Corner]) -> shapely.Polygon:
    north, east = metres_per_degree(MIDDLE[0])
    return shapely.Polygon([((lon - MIDDLE[1]) * east, (lat - MIDDLE[0]) * north) for lat, lon in ring])


def union(piece: Piece) -> shapely.Geometry:
    return shapely.union_all([plane(ring) for ring in piece.rings])


@st.composite
def stars(draw: st.DrawFn) -> list[Corner]:
    """A polygon, convex or not, some hundred metres wide: a point in each of several directions."""
    count = draw(st.integers(3, 12))
    reaches = draw(st.lists(st.floats(50, 900), min_size=count, max_size=count))
    turn = draw(st.floats(0, 6))
    north, east = metres_per_degree(MIDDLE[0])
    corners = [
        (
            MIDDLE[0] + reach * math.sin(turn + 2 * math.pi * at / count) / north,
            MIDDLE[1] + reach * math.cos(turn + 2 * math.pi * at / count) / east,
        )
        for at, reach in enumerate(reaches)
    ]
    return corners if draw(st.booleans()) else corners[::-1]


@given(stars(), st.lists(st.floats(0, 20) | st.just(0.0), min_size=1, max_size=8))
def test_the_pieces_are_disjoint_complete_and_in_proportion_to_the_shares(
    corners: list[Corner], shares: list[float]
) -> None:
    assume(sum(shares) > 1e-3 and all(share == 0 or share > 1e-3 for share in shares))
    area = Area(corners)
    pieces = area.divide(shares)
    whole, parts = plane(corners), [union(piece) for piece in pieces]
    assert math.isclose(area.area_m2, whole.area, rel_tol=1e-3)
    for at, part in enumerate(parts):
        for other in parts[at + 1 :]:
            assert part.intersection(other).area <= 1e-6 * whole.area, "disjoint"
    assert whole.difference(shapely.union_all(parts)).area <= 1e-6 * whole.area, "complete"
    assert shapely.union_all(parts).difference(whole).area <= 1e-6 * whole.area, "and nothing beyond it"
    for share, piece in zip(shares, pieces, strict=True):
        assert math.isclose(
            piece.area_m2, area.area_m2 * share / sum(shares), rel_tol=1e-6, abs_tol=1e-6 * area.area_m2
        )
        assert share > 0 or piece.rings == ()


@given(stars(), st.lists(st.floats(0.1, 5), min_size=2, max_size=5))
def test_pieces_lie_in_order_along_the_axis(corners: list[Corner], shares: list[float]) -> None:
    area = Area(corners)
    middles = [area.along_m(piece.middle) for piece in area.divide(shares)]
    assert middles == sorted(middles)


@pytest.mark.parametrize(
    "corners",
    [
        [(58.0, 15.0), (58.0, 15.1)],
        [(58.0, 15.0), (58.1, 15.1), (58.1, 15.0), (58.0, 15.1)],  # it crosses itself
        [(58.0, 15.0), (58.0, 15.1), (58.0, 15.2)],  # flat
        [(0.0, 0.0), (0.0, 3.0), (3.0, 3.0)],
        [(89.0, 0.0), (89.0, 0.5), (89.5, 0.5)],
    ],
)
def test_what_is_no_area_is_refused(corners: list[Corner]) -> None:
    with pytest.raises(Refused):
        Area(corners)


def test_without_shares_nothing_is_divided() -> None:
    area = Area([(58.0, 15.0), (58.0, 15.01), (58.01, 15.01)])
    with pytest.raises(Refused, match="no share"):
        area.divide([0.0, 0.0])
