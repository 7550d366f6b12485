"""KPL specifications: read, printed back, and what is said of wrong ones."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow.kpl.diagnostics.languages import language
from dyknow.kpl.syntax.listing import print_specification
from dyknow.kpl.syntax.specification import (
    FromSource,
    GeneratorDeclaration,
    MonitorDeclaration,
    Refinement,
    SourceDeclaration,
    StateStream,
    StreamDeclaration,
    StreamTerm,
    UnitDeclaration,
)
from dyknow.kpl.syntax.statements import MAX_ERRORS, parse_specification
from dyknow.model.errors import SourceText, TextError, TextErrors
from dyknow.model.labels import Label
from dyknow.policies.policy import Policy
from tests.kpl.specifications import specifications
from tests.strategies import examples

CARS = """
source pos pos_car1
strmgen pos[car1] = pos_car1
compunit speed SpeedEst(pos)
strmgen speed[car1] = SpeedEst(pos[car1] with sample every 200)
stream speed_car1 = speed[car1] with from 300 to 400
source pos pos_car2
strmgen pos[car2] = pos_car2
strmgen speed[car2] = SpeedEst(pos[car2] with max delay 100,
                               monotone order)   # of one stream, not two arguments
stream speed_car2 = speed[car2]
"""


def test_example_4_4_1() -> None:
    found = parse_specification(CARS)
    pos, speed = (Label("pos", ("car1",)), Label("speed", ("car1",)))
    assert found[:5] == (
        SourceDeclaration("pos", "pos_car1"),
        GeneratorDeclaration(pos, FromSource("pos_car1")),
        UnitDeclaration("speed", "SpeedEst", ("pos",)),
        GeneratorDeclaration(speed, Refinement("SpeedEst", (StreamTerm(pos, Policy.parse("sample every 200")),))),
        StreamDeclaration("speed_car1", StreamTerm(speed, Policy.parse("from 300 to 400"))),
    )
    late = Policy(max_delay_us=100_000, order="monotone")
    assert found[7].made == Refinement("SpeedEst", (StreamTerm(Label("pos", ("car2",)), late),))  # type: ignore[union-attr]
    assert found[4].place.line == 6


@pytest.mark.parametrize(
    "text",
    [
        "source pos pos_car1",  # 4.4.3
        "compunit speed SpeedEst(pos)",  # 4.4.4
        "strmgen pos[car1] = pos_car1",  # 4.4.6
        "strmgen speed[car1] = SpeedEst(pos[car1] with sample every 200)",  # 4.4.7
        "strmgen tracked_pos = select pos[car] for car in current_car",
        "strmgen all_pos = merge pos[car] for car in car_ids with max delay 1000",
        "for car in car_ids strmgen dist[car, uav1] = Distance(pos[car], pos[uav1])",
        "export heli-position = pos[self]",
        "stream sure = pos[car1] with min certainty 0.95, max deviation 2, importance 3",
        "import heli-position from 1 as pos[uav1] with sample every 1000, max delay 1000",
        "define hasCargo[u] = exists c in carryable: attached[u, c]",
        "define MIN_XY = 15.0",
        "monitor calm = always speed[self] < 5 with sample every 500, no value false, close after 3",
        'chronicle file "overtake.chr"',
        'want suspect in cars = always[0, 1s] (colour[suspect] = "red" and speed[suspect] > 5)',
        "strmgen cars = link(vision_objects, Car, eventually always[0, 1s] on_roadsystem[from], false, true)",
        "strmgen link = state(state[a], cars.link[car1]) with sample every 100, max delay 100",
        "strmgen for = in",
        "stream any_change = import with any change",
    ],
)
def test_what_is_typed_is_printed(text: str) -> None:
    assert print_specification(parse_specification(text)) == f"{text}\n"


def test_the_commas_of_arguments_and_of_constraints_are_told_apart() -> None:
    (found,) = parse_specification(
        "strmgen s = state(a with sample every 100, max delay 100, b, c with any change) with max delay 1s"
    )
    assert isinstance(found, GeneratorDeclaration)
    assert found.made == StateStream(
        (
            StreamTerm(Label("a"), Policy.parse("sample every 100, max delay 100")),
            StreamTerm(Label("b")),
            StreamTerm(Label("c"), Policy.parse("any change")),
        ),
        Policy.parse("max delay 1000"),
    )


def test_options_of_a_monitor_come_in_any_order() -> None:
    (found,) = parse_specification("monitor m = p with close after 4, max delay 1s, no value skip, sample every 100")
    assert isinstance(found, MonitorDeclaration)
    assert (found.close_after, found.no_value) == (4, "skip")
    assert found.policy == Policy.parse("sample every 100, max delay 1s")


@given(specifications)
def test_printing_and_reading_back_gives_the_same(specification) -> None:  # type: ignore[no-untyped-def]
    assert parse_specification(print_specification(specification)) == specification


WRONG = """\
source pos pos_car1
strmgen a = f(b with sample every 0, c)
strmgen d =
monitor m = always p -> q
stream e = a with use most recent
stream g = a with from 3 until 5
stream h = a
"""


def test_all_errors_of_a_text_are_told_each_at_its_place() -> None:
    with pytest.raises(TextErrors) as caught:
        parse_specification(SourceText(WRONG, "wrong.kpl"))
    assert [(error.line, error.column) for error in caught.value.errors] == [
        (2, 22),
        (3, 12),
        (4, 13),
        (5, 19),
        (6, 26),
    ]
    assert {error.file for error in caught.value.errors} == {"wrong.kpl"}
    assert caught.value.errors[4].repair == "from 300 to 400"
    assert str(caught.value).count("write: ") == 5


def test_a_wrong_statement_hides_none_of_the_others() -> None:
    lines = [f"strmgen a{number} = " for number in range(3 * MAX_ERRORS)]
    with pytest.raises(TextErrors) as caught:
        parse_specification("\n".join(lines))
    assert len(caught.value.errors) == MAX_ERRORS


@pytest.mark.parametrize(
    ("sample", "message"),
    [
        (sample, one.message)
        for one in language("statements").mistakes
        for sample in one.samples
        if not sample.startswith("monitor")
    ],
)
def test_common_mistakes_are_told_with_a_repair(sample: str, message: str) -> None:
    with pytest.raises(TextError) as caught:
        parse_specification(sample)
    assert caught.value.message == message
    assert caught.value.repair


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("monitor m = p with close after 0", "from 1 to"),
        ("monitor m = p with close after 2s", "from 1 to"),
        ("monitor m = p with close after 1.5", "from 1 to"),
        ("monitor m = p with no value skip, no value true", "one such option"),
        ("stream a = b with sample every 1, sample every 2", "one constraint of each kind"),
        ("stream a = b with from 5 to 3", "to"),
        ("strmgen a[-1] = b", "objects are names or whole numbers"),
        ("stream a = b with max delay 99999999999999999999h", "max delay"),
    ],
)
def test_wrong_numbers_and_policies_are_told(text: str, message: str) -> None:
    with pytest.raises(TextError, match=message):
        parse_specification(text)


WORDS = st.sampled_from(
    [
        *CARS.split(),
        "state(",
        ")",
        "with",
        "for",
        "in",
        "select",
        "merge",
        "link(",
        ",",
        "=",
        "[",
        "]",
        "until",
        "\n",
        "9",
    ]
)


@given(st.lists(WORDS, max_size=40).map(" ".join) | st.text(max_size=80))
@settings(max_examples=examples(200))
def test_any_text_is_read_or_refused_with_a_place(text: str) -> None:
    try:
        parse_specification(text)
    except TextError as error:
        assert 1 <= error.line <= text.count("\n") + 2
        assert error.message
