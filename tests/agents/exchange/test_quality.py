"""How certain a vehicle's samples are: stated in their own units, and known wherever they are queried or imported."""

import pytest

from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import Query, Samples
from dyknow.federation.sharing.ontology import default_ontology
from dyknow.federation.sharing.translation import Translation
from dyknow.navigation.geodesy import metres_per_degree
from dyknow.runtime.library.results import sample_of_reading, variances_in
from tests.box import Box, Vehicle

IMPORTING = """
import heli-position from 1 as pos[uav1] with sample every 100, max delay 1000
import heli-altitude from 1 as alt[uav1] with sample every 100, max delay 1000
stream all = pos[uav1]
stream within_9cm = pos[uav1] with max deviation 0.0000008
stream within_11m = pos[uav1] with max deviation 0.0001
stream high = alt[uav1] with max deviation 0.001
stream higher = alt[uav1] with max deviation 100
stream metres = alt.altitude_m[uav1] with max deviation 0.001
"""


def asked(wire: Box, label: str) -> Samples:
    (content,) = wire.asked("cc", "1", Query(semantic_label=label), Performative.QUERY_REF).contents
    assert isinstance(content, Samples)
    return content


def test_variances_are_in_the_square_of_the_fields_unit_and_read_in_metres(wire: Box) -> None:
    wire.join("1", Vehicle())
    wire.centre()
    wire.run(3.0)
    newest = wire.platform("1").ports.network.generator("estimate[1]").history.get_latest()
    for label, unit, axes in (
        ("heli-position", "m2", ("north", "east")),
        ("heli-altitude", "m2", ("altitude",)),
        ("heli-velocity", "m2_s2", ("north", "east", "down")),
        ("heli-height", "m2", ("height",)),
    ):
        (reading,) = asked(wire, label).samples
        sample = sample_of_reading("1", label, reading)
        assert list(sample.variances) == [unit]
        assert tuple(sample.variances[unit]) == axes
        assert all(0.0001 < stated < 25.0 for stated in sample.variances[unit].values())
    (reading,) = asked(wire, "heli-position").samples
    per_degree = metres_per_degree(58.0)
    assert reading.variance["latitude_deg"] * per_degree[0] ** 2 == pytest.approx(newest.value.var_n, rel=0.2)
    assert reading.variance["longitude_deg"] * per_degree[1] ** 2 == pytest.approx(newest.value.var_e, rel=0.2)


def test_an_importer_leaves_out_what_deviates_by_more_than_it_asks_for(wire: Box) -> None:
    wire.join("1", Vehicle())
    wire.join("0", Vehicle(east_m=500.0))
    wire.specify("0", IMPORTING, "0.kpl")
    wire.run(6.0)
    told = [each for each in wire.nodes["0"].results if each["event"] == "sample"]
    counts = {name: sum(each["stream"] == name for each in told) for name in ("all", "within_11m", "higher")}
    assert min(counts.values()) > 30
    assert len(set(counts.values())) == 1
    assert {each["stream"] for each in told} == set(counts), "centimetres of deviation are not what a GPS states"


def test_a_platform_with_other_units_imports_the_deviation_in_them(wire: Box) -> None:
    text = '[heli-altitude]\nlocal = "feet[{unit}]"\nfields = { altitude_m = { name = "alt_ft", unit = "ft" } }\n'
    wire.join("1", Vehicle())
    wire.join("0", Vehicle(), translation=Translation.parse(default_ontology(), text))
    wire.centre()
    wire.run(3.0)
    exported, local = (wire.platform(unit).ports.network for unit in ("1", "0"))
    stated = exported.generator("heli-altitude[1]").history.get_latest().quality.deviation
    own = local.generator("feet[0]").history.get_latest().quality.deviation
    assert own == pytest.approx(stated / 0.3048, rel=0.05)


def test_fields_without_a_unit_in_their_name_keep_their_own() -> None:
    found = variances_in({"fraction": 0.5, "roll_rad": 0.0, "climb_m_s2": 1.0, "latitude_deg": 0.0},
                         {"fraction": 0.25, "roll_rad": 1.0, "climb_m_s2": 9.0, "latitude_deg": 1e-10})  # fmt: skip
    assert found["m2"] == {"north": pytest.approx(1e-10 * metres_per_degree(0.0)[0] ** 2)}
    assert {unit: found[unit] for unit in ("", "rad2", "m2_s4")} == {
        "": {"fraction": 0.25},
        "rad2": {"roll": 1.0},
        "m2_s4": {"climb": 9.0},
    }


def test_what_comes_from_a_platform_is_as_much_less_certain_as_that_is_trusted_and_it_is_said(wire: Box) -> None:
    wire.join("1", Vehicle())
    wire.join("0", trusted={"1": 0.6})
    text = (
        "import heli-altitude from 1 as alt[uav1] with sample every 100, max delay 1000\n"
        "stream sure = alt[uav1] with min certainty 0.7\nstream unsure = alt[uav1] with min certainty 0.5\n"
    )
    wire.specify("0", text)
    wire.run(3.0)
    samples = [each for each in wire.nodes["0"].results if each["event"] == "sample"]
    assert {each["stream"] for each in samples} == {"unsure"}
    assert any("platform 1 is trusted by 0.6, as declared" in note for note in wire.nodes["0"].notes)
