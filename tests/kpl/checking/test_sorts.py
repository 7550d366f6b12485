"""Sorts with units and fields, declared in KPL and in modules of units: what is not of its sort is refused and reported."""

import pytest

from dyknow import Field, Sort, computational_unit, prototypes_in, source, value_unit, variant
from dyknow.model.errors import TextErrors
from dyknow.model.semantic_labels import SemanticLabel
from tests.kpl.instances import Running

GAS = Sort("gas", unit="ppm")
WIND = Sort("wind", (Field("north_m_s", "m/s"), Field("east_m_s", "m/s")))


@source(GAS)
def sniffer(from_us: int):
    """Every third value is none of gas in ppm."""
    number = -(-from_us // 10_000)
    while True:
        yield number * 10_000, ("a lot" if number % 3 == 2 else float(number))
        number += 1


@value_unit(WIND, GAS, name="Blown")
def blown(gas):
    return (gas, gas) if gas < 5 else (gas, "east")


@computational_unit("speed", WIND, name="Northward", samplewise=True)
def northward(_now_us, wind):
    return wind.value[0]


UNITS = tuple(prototypes_in([sniffer, blown, northward]))
CHAIN = """\
source gas sniffer
compunit wind Blown(gas)
compunit speed Northward(wind)
strmgen gas[self] = sniffer
strmgen wind[self] = Blown(gas[self])
strmgen speed[self] = Northward(wind[self])
stream seen = gas[self]
stream felt = wind[self]
stream north = wind.north_m_s[self]
stream speed = speed[self]
"""


def refused(text: str, **more) -> list[str]:
    """Place and cause of every error."""
    with pytest.raises(TextErrors) as found:
        Running(text, prototypes=UNITS, **more)
    return [f"{each.line}: {each.message}" for each in found.value.errors]


def test_a_module_says_what_values_are_and_what_is_not_of_it_is_refused_and_reported() -> None:
    running = Running(CHAIN, prototypes=UNITS)
    running.wait(95_000)
    assert running.values("seen") == [0, 1, 3, 4, 6, 7, 9]
    assert running.values("felt") == [(0, 0), (1, 1), (3, 3), (4, 4)]
    assert running.values("north") == running.values("speed") == [0, 1, 3, 4]
    said = "\n".join(f"{name}: {fault}" for name, fault in running.faults)
    assert "gas [ppm]: 'a lot'" in said
    assert "wind[7]" in said


def test_names_alone_are_sorts_of_any_value_as_before() -> None:
    assert [each.checked_sorts for each in UNITS] == [(GAS,), (WIND, GAS), (WIND,)]
    assert UNITS[2].sort == "speed"
    other = variant(blown, "Elsewhere", "breeze", "gas")
    assert (other.sort, other.checked_sorts) == ("breeze", (GAS,))


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("sort gas in percent\nsource gas sniffer\nstrmgen gas[self] = sniffer\n", 1),
        ('label gas-level : gas in percent "gas"\nsource gas sniffer\nstrmgen gas[self] = sniffer\n', 1),
        ("source gas sniffer\nstrmgen gas[self] = sniffer\nsort gas(much in ppm)\n", 3),
    ],
)
def test_a_specification_and_a_module_that_differ_about_a_sort_are_told_where(text: str, line: int) -> None:
    errors = refused(text)
    assert any(each.startswith(f"{line}: the sort gas is declared already, as gas in ppm") for each in errors), errors


@pytest.mark.parametrize(
    ("text", "line"), [("source gas sniffer\nstrmgen gas[self] = sniffer\n", 1), ("strmgen gas[self] = sniffer\n", 1)]
)
def test_what_the_ontology_has_otherwise_is_told_at_the_unit_whether_it_is_declared_or_not(
    text: str, line: int
) -> None:
    percent = Sort("gas", unit="percent")
    semantic = {"gas-level": SemanticLabel("gas-level", percent, "gas in the air")}
    assert refused(text, sorts={"gas": percent}, semantic=semantic) == [
        f"{line}: the sort gas is gas in percent here; sniffer is implemented with gas in ppm"
    ]


def test_two_modules_that_differ_about_a_sort_are_told() -> None:
    @value_unit("number", Sort("gas", unit="percent"), name="Other")
    def other(gas):
        return gas

    text = "source gas sniffer\ncompunit number Other(gas)\nstrmgen gas[self] = sniffer\nstrmgen n = Other(gas[self])\n"
    with pytest.raises(TextErrors, match=r"gas in p.*; (sniffer|Other) is implemented with gas in p"):
        Running(text, prototypes=(*UNITS, *prototypes_in([other])))


def test_a_label_of_a_sort_that_a_module_declares_needs_no_unit_of_its_own() -> None:
    text = 'label gas-level : gas "gas in the air"\nsource gas sniffer\nstrmgen gas[self] = sniffer\nexport gas-level = gas[self]\n'
    running = Running(text, prototypes=UNITS, semantic={})
    assert running.instance.symbols.semantic("gas-level").sort == GAS
    assert "1: what values of sort gaz are is not declared" in refused(text.replace(": gas ", ": gaz "), semantic={})
