from itertools import cycle
from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.federation import keys
from dyknow.federation.sharing.ontology import Ontology, default_ontology
from dyknow.federation.sharing.translation import Translation, convert_units
from dyknow.model.errors import DyknowError, SortError, TextError, UnknownLabel
from dyknow.model.labels import Label
from dyknow.model.sample import Quality, Sample
from dyknow.model.values import NO_VALUE, Field, Sort

FEET = """
[heli-altitude]
local = "alt_baro[{unit}]"
sort = "feet"
fields = { altitude_m = { name = "alt_ft", unit = "ft" } }

[heli-position]
local = "where[{unit}]"
fields = { longitude_deg = { name = "lon", unit = "rad" }, latitude_deg = { name = "lat", unit = "degE7" } }

[heli-velocity]
fields = { down_m_s = { name = "climb", unit = "ft/min", negated = true } }
"""
FLOATS = st.floats(-1e6, 1e6)


def test_the_built_in_labels_are_those_of_the_federation() -> None:
    ontology = default_ontology()
    assert ontology["heli-position"].sort == Sort(
        "position", (Field("latitude_deg", "deg"), Field("longitude_deg", "deg"))
    )
    assert ontology["heli-altitude"].sort.fields == (Field("altitude_m", "m"),)
    assert ontology["heli-height"].sort.fields == (Field("height_m", "m"),)
    assert [field.name for field in ontology["heli-velocity"].sort.fields] == ["north_m_s", "east_m_s", "down_m_s"]
    assert ontology["battery"].sort.fields == (Field("fraction", "fraction"),)
    for name in ontology:
        assert keys.label(name) == name
        assert keys.token_label("a", "0", name, ontology[name].type_hash, 0)
    assert len({ontology[name].type_hash for name in ontology}) == len(ontology)


def test_an_unknown_label_names_what_is_known() -> None:
    assert "wings" not in default_ontology()
    with pytest.raises(UnknownLabel, match="heli-position"):
        default_ontology()["wings"]


def test_a_file_adds_labels_and_changes_none() -> None:
    added = default_ontology().extended(
        '[max-speed]\nsort = "speed"\nmeaning = "at most"\nfields = { speed_m_s = "m/s" }\n'
    )
    assert len(added) == len(default_ontology()) + 1
    added["max-speed"].check((30.0,))
    with pytest.raises(SortError):
        added["max-speed"].check((30.0, 1.0))
    again = added.extended('[max-speed]\nsort = "speed"\nmeaning = "at most"\nfields = { speed_m_s = "m/s" }\n', "b")
    assert again["max-speed"] == added["max-speed"]
    for other in ('meaning = "at least"\nfields = { speed_m_s = "m/s" }', 'meaning = "at most"\nunit = "km/h"'):
        with pytest.raises(TextError, match="already"):
            added.extended(f'[max-speed]\nsort = "speed"\n{other}\n')


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("[", 1),
        ('\n[Wings]\nsort = "s"\nmeaning = "m"\nfields = { a = "m" }', 2),
        ('\n["a/*"]\nsort = "s"\nmeaning = "m"\nfields = { a = "m" }', 2),
        ('[a]\nsort = "s"\nmeaning = "m"', 1),
        ('[a]\nsort = "s"\nmeaning = "m"\nfields = {}', 4),
        ('[a]\nsort = "s"\nmeaning = "m"\nfields = { a = 5 }', 4),
        ('[a]\nsort = "s"\nmeaning = "m"\nfields = { A = "m" }', 1),
        ('[a]\nsort = "s"\nmeaning = "m"\nfields = { a = "m" }\ncolour = "red"', 5),
    ],
)
def test_a_wrong_ontology_says_where(text: str, line: int) -> None:
    with pytest.raises(TextError) as wrong:
        default_ontology().extended(text, "mine.toml")
    assert wrong.value.line == line
    assert "mine.toml" in str(wrong.value)


@pytest.mark.parametrize(
    ("number", "source", "target", "expected"),
    [
        (1000.0, "ft", "m", 304.8),
        (1.0, "nmi", "m", 1852.0),
        (36.0, "km/h", "m/s", 10.0),
        (1.0, "kt", "km/h", 1.852),
        (180.0, "deg", "rad", pi),
        (pi, "rad", "deg", 180.0),
        (584000000.0, "degE7", "deg", 58.4),
        (42.0, "percent", "fraction", 0.42),
        (100.0, "degC", "degF", 212.0),
        (0.0, "K", "degC", -273.15),
        (1.5, "s", "us", 1.5e6),
        (600.0, "ft/min", "m/s", 3.048),
    ],
)
def test_units_convert_in_both_directions(number: float, source: str, target: str, expected: float) -> None:
    assert convert_units(source, target)(number) == pytest.approx(expected, rel=1e-12)
    assert convert_units(target, source)(expected) == pytest.approx(number, rel=1e-12)


def test_units_of_different_things_do_not_convert() -> None:
    for source, target in [("m", "s"), ("m", "cubit"), ("deg", "degC")]:
        with pytest.raises(DyknowError, match="does not convert"):
            convert_units(source, target)


def test_without_a_translation_a_platform_speaks_as_the_ontology() -> None:
    plain = Translation(default_ontology())
    assert plain.local_label("heli-altitude", "0") == Label("heli-altitude", ("0",))
    assert plain.local_sort("heli-altitude") == default_ontology()["heli-altitude"].sort
    value = (58.4, 15.6)
    assert plain.to_local("heli-position")(value) is value
    assert plain.to_semantic("heli-position")(value) is value


def test_a_platform_with_other_names_units_and_order_is_understood() -> None:
    platform = Translation.parse(default_ontology(), FEET)
    assert platform.local_label("heli-altitude", "uav1") == Label.parse("alt_baro[uav1]")
    assert platform.local_sort("heli-altitude") == Sort("feet", (Field("alt_ft", "ft"),))
    assert platform.to_semantic("heli-altitude")((1000.0,)) == (pytest.approx(304.8),)
    assert platform.local_sort("heli-position").fields == (Field("lon", "rad"), Field("lat", "degE7"))
    assert platform.to_semantic("heli-position")((pi / 12, 584000000.0)) == (pytest.approx(58.4), pytest.approx(15.0))
    assert platform.local_sort("heli-velocity").fields[0] == Field("climb", "ft/min")
    assert platform.to_semantic("heli-velocity")((600.0, 1.0, 2.0)) == (1.0, 2.0, pytest.approx(-3.048))
    assert platform.semantic_label(Label.parse("alt_baro[uav1]"), "uav1") == "heli-altitude"
    assert platform.semantic_label(Label.parse("alt_baro[uav1]"), "0") is None


def test_samples_are_converted_on_their_way_to_a_consumer_and_without_other_units_it_is_called_itself() -> None:
    taken: list[Sample] = []
    take = taken.append
    assert Translation(default_ontology()).to_local("heli-altitude").into(take) is take
    Translation.parse(default_ontology(), FEET).to_local("heli-altitude").into(take)(Sample(2, 1, (304.8,)))
    assert taken == [Sample(2, 1, (pytest.approx(1000.0),))]


def test_a_covariance_is_converted_with_the_numbers_and_left_out_if_it_is_not_of_all() -> None:
    where = Translation.parse(default_ontology(), FEET).to_local("heli-position")
    there = where.sample(Sample(1, 1, (10.0, 180.0), Quality(0.5, ((4.0, 1.0), (1.0, 9.0)))))
    assert there.value == (pytest.approx(pi), pytest.approx(1e8))
    (lon, between), (other, lat) = there.quality.covariance
    assert (lon, lat) == (pytest.approx(9.0 * (pi / 180) ** 2), pytest.approx(4.0 * 1e14))
    assert between == other == pytest.approx(1e7 * pi / 180)
    assert where.quality(Quality(0.5, ((4.0,),))) == Quality(0.5)
    climb = Translation.parse(default_ontology(), FEET).to_local("heli-velocity")
    assert climb.quality(Quality(1.0, ((1.0, 0.0, 2.0), (0.0, 1.0, 0.0), (2.0, 0.0, 1.0)))).covariance[0][1] < 0.0


@given(FLOATS, FLOATS, FLOATS)
def test_translation_there_and_back_is_the_same_value(one: float, two: float, three: float) -> None:
    platform = Translation.parse(default_ontology(), FEET)
    for name in default_ontology():
        sort = platform.local_sort(name)
        numbers = cycle((one, two, three))
        value = tuple({"text": "red", "bool": True}.get(field.unit) or next(numbers) for field in sort.fields)
        sort.check(value)
        there = platform.to_semantic(name)(value)
        default_ontology()[name].check(there)
        back = platform.to_local(name)(there)
        assert [each for each in back if isinstance(each, float)] == pytest.approx(
            [each for each in value if isinstance(each, float)], rel=1e-9, abs=1e-9
        )
        assert [each for each in back if not isinstance(each, float)] == [
            each for each in value if not isinstance(each, float)
        ]


def test_records_with_texts_are_translated_too() -> None:
    units = {"x_m": "ft", "y_m": "ft", "sd_m": "ft", "symbol": "text", "colour": "text", "end": "bool"}
    fields = ", ".join(f'{name} = {{ name = "{name}", unit = "{unit}" }}' for name, unit in units.items())
    feet = f"[vision-percepts]\nfields = {{ {fields} }}\n"
    where = Translation.parse(default_ontology(), feet)
    value = where.to_semantic("vision-percepts")((100.0, -50.0, 1.0, "vp1", NO_VALUE, False))
    assert value == ("vp1", pytest.approx(30.48), pytest.approx(-15.24), pytest.approx(0.3048), NO_VALUE, False)


def test_no_value_stays_no_value() -> None:
    platform = Translation.parse(default_ontology(), FEET)
    assert platform.to_semantic("heli-altitude")(NO_VALUE) is NO_VALUE
    assert platform.to_semantic("heli-position")((NO_VALUE, 584000000.0)) == (pytest.approx(58.4), NO_VALUE)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[wings]", "not in the ontology"),
        ('[battery]\ncolour = "red"', "only local"),
        ("battery = 5", "only local"),
        ("[battery]\nlocal = 5", "texts"),
        ('[battery]\nlocal = "a b"', "battery"),
        ('[battery]\nfields = { volts = { unit = "V" } }', "no field volts"),
        ('[battery]\nfields = { fraction = { unit = "V" } }', "does not convert"),
        ("[battery]\nfields = { fraction = { scale = 5 } }", "only name"),
        ("[battery]\nfields = { fraction = { unit = 5 } }", "texts"),
        ("[battery]\nfields = { fraction = 5 }", "only name"),
    ],
)
def test_a_wrong_translation_is_explained(text: str, said: str) -> None:
    with pytest.raises(TextError, match=said):
        Translation.parse(default_ontology(), text)


def test_an_ontology_can_be_made_from_nothing() -> None:
    assert len(Ontology({})) == 0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[gas]\nsort = "gas"\nunit = nan\nmeaning = "m"', "gas.unit: a text is expected, got NaN"),
        ('[gas]\nsort = "gas"\nfields = { a = inf }\nmeaning = "m"', "gas.fields.a: a text is expected, got Infinity"),
        (
            '[gas]\nsort = "gas"\nfields = { a = { a = { a = "m" } } }\nmeaning = "m"',
            'gas.fields.a: a text is expected, got {"a": {"a": "m"}}',
        ),
        ("gas = " + "[" * 5000 + "]" * 5000, "nested too deep"),
        ('[gas]\nsort = "gas"\nunit = "ppm"\nmeaning = "gas \\u001b[2J"', "characters that are not shown"),
        ('[gas]\nsort = "gas"\nunit = "ppm"\nmeaning = "gas \\u202e"', "characters that are not shown"),
        ('["gas\\u0007"]\nsort = "gas"\nunit = "ppm"\nmeaning = "m"', "is no semantic label"),
        ('[gas]\nsort = "gas"\nunit = "ppm"\nmeaning = "m"\n[gas]\n', "no TOML"),
        (f'[gas]\nsort = "gas"\nunit = "ppm"\nmeaning = "{"m" * 201}"', "the meaning has 201 characters"),
        ("# " + "a" * 200_000, "at most 131072 are read"),
        ('gas = "gas"', 'gas: a table is expected, got "gas"'),
        ('[battery]\nsort = "charge"\nunit = "percent"\nmeaning = "what is left"', "already (built in)"),
        (
            '[gas]\nsort = "charge"\nunit = "ppm"\nmeaning = "m"',
            "the sort charge is charge(fraction in fraction) already",
        ),
    ],
)
def test_a_hostile_ontology_is_refused_with_the_cause_in_plain_text(text: str, said: str) -> None:
    with pytest.raises(TextError) as wrong:
        default_ontology().extended(text, "mine.toml")
    assert said in wrong.value.message
    assert all(char.isprintable() for char in wrong.value.message)
    assert "gas" not in default_ontology()


def test_a_platform_has_no_more_labels_than_what_it_says_of_itself_can_hold() -> None:
    label = '[gas-{n}]\nsort = "gas"\nunit = "ppm"\nmeaning = "{m}"\n'
    many = "".join(label.format(n=n, m="m") for n in range(128))
    assert len(default_ontology().extended(many).own()) == 128
    with pytest.raises(TextError, match="at most 128 labels of its own"):
        default_ontology().extended(many + label.format(n=128, m="m"))
    with pytest.raises(TextError, match="of 24000 characters together"):
        default_ontology().extended("".join(label.format(n=n, m="m" * 200) for n in range(128)))
