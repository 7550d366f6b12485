"""Persons that cameras see become entries, and entries of all platforms one map."""

from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import SaliencyRows
from tests.agents.capabilities.saliency.rescuing import Rescue

BOTH = ((70.0, 100.0), (85.0, 100.0))


def test_two_platforms_over_one_place_have_one_map_with_each_person_once():
    rescue = Rescue(seed=1, over=BOTH, image_us=200_000)
    rescue.world.run_for(14.0)
    both = rescue.places("0")
    assert [place.name for place in both] == [place.name for place in rescue.places("1")]
    errors, wrong = rescue.errors_m("0")
    assert len(errors) >= 2
    assert wrong == 0
    assert max(errors) < 2.0
    assert any(place.by == ("0", "1") for place in both)
    asked = rescue.world.ask("cc", "1", SaliencyRows(), Performative.QUERY_REF)
    rescue.world.run_for(1.0)
    rows = [row for said in asked.results for row in said.rows]
    assert {row.symbol for row in rows} == {place.name for place in both}
    seen = rows[0].attributes
    assert seen["thermal_image"].split("/")[1] == "thermal"
    assert seen["colour_image"].split("/")[1] == "colour"
    assert abs(seen["latitude_deg"] - 55.724) < 0.01
