import json
from pathlib import Path
from typing import Any

import pytest

from dyknow.federation.messages.contents import DivideArea
from dyknow.model.errors import WrongCall
from dyknow.runtime.configuration.areas import corners_of
from dyknow.runtime.configuration.wording import content_with

RING = [[15.0, 58.0], [15.1, 58.0], [15.1, 58.1], [15.0, 58.0]]
POLYGON = {"type": "Polygon", "coordinates": [RING]}


def test_an_area_is_read_from_geojson_or_typed(tmp_path: Path) -> None:
    file = tmp_path / "field.geojson"
    for found in (POLYGON, {"type": "Feature", "geometry": POLYGON}):
        file.write_text(json.dumps({"type": "FeatureCollection", "features": [found]}), encoding="utf-8")
        content = content_with("divide-area", {"area": str(file), "sensor": "battery"}, 0)
        assert isinstance(content, DivideArea)
        assert content.area == ("58.0000000 15.0000000", "58.0000000 15.1000000", "58.1000000 15.1000000")
    typed = content_with("divide-area", {"area": "58 15, 58 15.1, 58.1 15.1"}, 0)
    assert isinstance(typed, DivideArea)
    assert typed.area == ("58 15", "58 15.1", "58.1 15.1")


@pytest.mark.parametrize(
    ("found", "said"),
    [
        ("{", "cannot be read"),
        ([], "cannot be read"),
        ({"type": "Point"}, "has 0 Polygons"),
        ({"type": "FeatureCollection", "features": [POLYGON, POLYGON]}, "has 2 Polygons"),
        ({"type": "Polygon", "coordinates": [RING, RING]}, "not one ring"),
        ({"type": "Polygon", "coordinates": [[["a", 1], [2], None]]}, "not one ring"),
        ({"type": "Polygon", "coordinates": 3}, "not one ring"),
        ({"type": "Polygon", "coordinates": [RING[:2]]}, "2 corners"),
        ({"type": "Polygon", "coordinates": [[[at / 100, at**2 / 1000] for at in range(40)]]}, "40 corners"),
        ({"type": "FeatureCollection", "features": 3}, "cannot be read"),
    ],
)
def test_what_is_no_area_is_refused_with_the_reason(tmp_path: Path, found: Any, said: str) -> None:
    file = tmp_path / "field.geojson"
    file.write_text(found if isinstance(found, str) else json.dumps(found), encoding="utf-8")
    with pytest.raises(WrongCall, match=said):
        corners_of(str(file))


def test_a_place_that_is_none_is_refused() -> None:
    with pytest.raises(WrongCall, match="no place"):
        content_with("divide-area", {"area": "58 15, 98 15.1, 58.1 15.1"}, 0)
