"""What is wrong with a specification as a whole: names, arities, sorts, cycles, what nobody reaches."""

import pytest
from hypothesis import given

from dyknow.kpl import Findings, Known, parse_specification
from dyknow.model.errors import SourceText
from dyknow.model.labels import Label
from dyknow.model.semantic_labels import SemanticLabel
from dyknow.model.values import Sort
from tests.kpl.specifications import check_specification, specifications
from tests.kpl.syntax.test_statements import CARS

KNOWN = Known(
    sorts={"pos", "speed", "object"},
    units={"Est": ("speed", ("pos",)), "Fuse": ("pos", ("pos", "pos")), "SpeedEst": ("speed", ("pos",))},
    labels={Label("car_ids"): "object", Label("battery", ("uav1",)): "fraction"},
    semantic={"heli-position": SemanticLabel("heli-position", Sort("pos", unit="m"), "where it is")},
)
BASE = """\
source pos gps
compunit speed Est(pos)
compunit pos Fuse(pos, pos)
strmgen pos[uav1] = gps
strmgen speed[uav1] = Est(pos[uav1])
stream out = speed[uav1]
stream fused = other
strmgen other = Fuse(pos[uav1], pos[uav1])
"""


def found(text: str, known: Known = KNOWN) -> Findings:
    text = SourceText(text, "a.kpl")
    return check_specification(parse_specification(text), known, text)


def test_the_car_example_is_right() -> None:
    assert found(CARS) == ((), ())
    assert found(BASE) == ((), ())


@pytest.mark.parametrize(
    ("more", "message", "repair"),
    [
        ("source pos gps", "gps is a source or a unit already, in line 1", "another name"),
        ("compunit pos gps(pos)", "gps is a source or a unit already, in line 1", "another name"),
        ("source pos Est", "Est is a source or a unit already, in line 2", "another name"),
        ("strmgen pos[uav1] = gps", "pos[uav1] is a generator already, in line 4", "another name"),
        ("import heli-position from 1 as pos[uav1]", "pos[uav1] is a generator already, in line 4", "another name"),
        ("strmgen car_ids = gps", "car_ids is a generator already, in the running instance", "another name"),
        ("stream out = pos[uav1]", "out is a stream already, in line 6", "another name"),
        ("export heli-position = other\nexport heli-position = other", "an export already, in line 9", "another name"),
        ("monitor m = true\nmonitor m = false", "m is a monitor already, in line 9", "another name"),
        ("define f[a] = true\ndefine f[b] = false", "f is a definition already, in line 9", "another name"),
        ("source psos gsm", "there is no sort psos", "pos"),
        ("compunit speed Est2(position)", "there is no sort position", ""),
        ("strmgen pos[uav2] = gsp", "gsp is no source that is declared", "gps"),
        ("strmgen pos[uav2] = Est", "Est is a unit, which takes streams", "Est(pos)"),
        ("strmgen pos[uav2] = gps(pos[uav1])", "gps is a source, which takes no streams", "gps"),
        ("strmgen a = Ets(pos[uav1])", "Ets is no computational unit that is declared", "Est"),
        ("strmgen a = Est(pos[uav1], pos[uav1])", "Est takes 1 stream (pos), not 2", "Est(pos[uav1])"),
        ("strmgen a = Fuse(pos[uav1])", "Fuse takes 2 streams (pos, pos), not 1", "Fuse(pos, pos)"),
        ("strmgen a = Est(speed[uav1])", "Est takes pos here; speed[uav1] is speed", "a stream of pos"),
        ("strmgen a = Est(battery[uav1])", "Est takes pos here; battery[uav1] is fraction", "a stream of pos"),
        ("strmgen s = state(pos[uav1], other)\nstrmgen a = Est(s)", "s is state", "a stream of pos"),
        ("stream a = pos[uav2]", "nothing makes pos[uav2]", "pos[uav1]"),
        ("stream a = pos", "nothing makes pos", ""),
        ("export heli-position = psition", "nothing makes psition", ""),
        ("export heli-postion = other", "the ontology has no label heli-postion", "heli-position"),
        ("import heli from 1 as x", "the ontology has no label heli", ""),
        ("strmgen a = Est(a)", "a cycle: a <- a", "a stream from outside the cycle"),
        ("strmgen a = Est(b)\nstrmgen b = Fuse(pos[uav1], a)", "a cycle: a <- b <- a", "from outside"),
        ("for c in car_ids strmgen x[c] = Fuse(x[c], x[c])", "a cycle: x[c] <- x[c]", "from outside"),
        ("strmgen m = merge m2[c] for c in car_ids\nstrmgen m2[a] = Fuse(m, m)", "a cycle: m <- m2[a] <- m", "outside"),
        ("strmgen a = select pos[c] for c in nobody", "nothing makes nobody", ""),
        ("strmgen a = select other for c in car_ids", "other is the same for every c", "other[c]"),
        ("for c in car_ids strmgen x = Est(pos[c])", "every member of the stream would make x", "x[c]"),
        ("strmgen a = link(speed[uav1], Est, true, false, true)", "Est takes pos here; speed[uav1] is speed", "speed"),
        ("strmgen a = link(nobody, Est, true, false, true)", "nothing makes nobody", ""),
    ],
)
def test_an_error_names_its_place_and_the_repair(more: str, message: str, repair: str) -> None:
    errors = found(BASE + more).errors
    told = [error for error in errors if message in error.message]
    assert len(told) == 1, [error.message for error in errors]
    assert repair in told[0].repair
    assert told[0].line >= 9
    assert told[0].file == "a.kpl"
    assert "^" in told[0].drawn()


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("source pos unused", "nothing is made from unused"),
        ("compunit pos Unused(pos)", "nothing is made from Unused"),
        ("strmgen x = Est(pos[uav1])", "x has no subscriber here"),
        (
            "compunit pos Late(pos)\nstrmgen x = Late(pos[uav1])\nstream late = x",
            "no module offers Late: x and what is made of it wait",
        ),
        (
            "compunit pos Late(pos)\nfor c in car_ids strmgen x[c] = Late(pos[c])\nstream late = x[car1]",
            "no module offers Late: x[c] and what is made of it wait",
        ),
    ],
)
def test_what_nobody_reaches_is_a_warning(more: str, message: str) -> None:
    errors, warnings = found(BASE + more)
    assert errors == ()
    assert [warning.message for warning in warnings] == [message]


@pytest.mark.parametrize(
    "more",
    [
        "strmgen a = select pos[c] for c in car_ids\nstream b = a",
        "for c in car_ids strmgen dist[c] = Fuse(pos[c], pos[uav1])\nstream b = dist[car7]",
        "strmgen a = merge dist[c] for c in car_ids\nfor c in car_ids strmgen dist[c] = Est(pos[c])\nstream b = a",
        "import heli-position from 1 as pos[uav2]\nstream b = pos[uav2]\nstrmgen e = Est(pos[uav2])\nstream f = e",
        "strmgen cars = link(pos[uav1], Est, true, false, true)\nstream l = cars.link[car1]",
        "strmgen x[uav1] = Est(pos[uav1])\nmonitor m = always x[uav1] > 3",
        "strmgen x[uav1] = Est(pos[uav1])\ndefine fast[u] = x[u] > 3",
        "stream late = speed[uav1] with max delay 3",
    ],
)
def test_what_is_right_is_accepted(more: str) -> None:
    assert found(BASE + more) == ((), ())


@pytest.mark.parametrize(
    ("inputs", "policy", "warned"),
    [
        ("pos[uav1] with sample every 200, pos[uav1]", "sample every 100, max delay 9", 1),
        ("pos[uav1] with sample every 200, pos[uav1] with sample every 200", "max delay 9", 2),
        ("pos[uav1] with sample every 200, from 0", "sample every 100, max delay 9", 0),
        ("pos[uav1] with sample every 200, pos[uav1]", "any change", 0),
        ("pos[uav1], pos[uav1]", "sample every 100, max delay 9", 0),
    ],
)
def test_states_over_grids_that_need_not_meet_theirs_are_warned_of(inputs: str, policy: str, warned: int) -> None:
    errors, warnings = found(f"{BASE}strmgen s = state({inputs}) with {policy}\nstream t = s")
    assert errors == ()
    assert len(warnings) == warned
    assert all(
        "need not meet" in one.message and one.repair == "pos[uav1] with sample every 200ms, from 0" for one in warnings
    )


def test_errors_come_in_the_order_of_the_text_and_all_of_them() -> None:
    lines = ["strmgen b = Ets(pos[uav1])", "source psos g2", "stream x = nothing"]
    errors = found(BASE + "\n".join(lines)).errors
    assert [error.line for error in errors] == [9, 10, 11]


@pytest.mark.parametrize(
    "text",
    [
        "strmgen speed = select link[q] for q in p\n",
        "strmgen xy_dist[a, b] = select z_dist[q, b] for q in p\nstrmgen z_dist[c, d] = select xy_dist[q, d] for q in p\n",
    ],
)
def test_streams_called_like_derived_features_may_be_selected_from_what_nothing_makes(text: str) -> None:
    assert any(error.message == "nothing makes p" for error in found(text, Known()).errors)


@given(specifications)
def test_any_specification_is_judged(specification) -> None:  # type: ignore[no-untyped-def]
    """Whatever it says, and with nothing known."""
    errors, warnings = check_specification(specification)
    assert all(found.message for found in (*errors, *warnings))
