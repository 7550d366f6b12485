"""What may be said of a link behind `with`: read, printed, refused, and what each option does."""

import pytest

from dyknow.anchoring.links.deciding.gating import gate_of
from dyknow.anchoring.links.prediction import ConstantVelocity, HabitualMotion
from dyknow.anchoring.links.specification import distance, unlikelihood
from dyknow.anchoring.roads.prediction import AlongRoads
from dyknow.kpl import parse_specification
from dyknow.kpl.checking.symbols import Known, SymbolTable
from dyknow.kpl.linking.declarations import link_specifications, linkage_key, links_in
from dyknow.kpl.syntax.listing import print_declaration
from dyknow.kpl.syntax.statements import roads_of
from dyknow.model.errors import TextErrors
from tests.kpl.linking.test_linking import PERCEPTS, WORLD, Camera, read_file

LINK = "strmgen world = link(percepts, WorldObject, true, xy_dist[from, to] < 5, true)"


def specification(options="", unit="WorldObject", roads=None):
    """The link specification with some options."""
    declarations = parse_specification(LINK.replace("WorldObject", unit) + options)
    (found,) = link_specifications(linkage_key(links_in(declarations), SymbolTable(declarations, Known(roads=roads))))
    return found


def test_options_are_printed_as_they_are_typed_and_usual_ones_are_not() -> None:
    options = " with forget 1min, score distance, predict individual, errors correlated, max_hyps 8, candidates 3, branches 4, exclusive kind"
    (declared,) = parse_specification(LINK + options)
    assert print_declaration(declared).endswith(options)
    (usual,) = parse_specification(
        LINK + " with forget 30s, score likelihood, errors independent, max_hyps 32, candidates 1"
    )
    assert "with" not in print_declaration(usual)
    assert (usual,) == parse_specification(LINK)


def test_each_option_is_that_of_the_link_process() -> None:
    found = specification(" with forget 2s, score distance, errors correlated, candidates 3, exclusive kind")
    assert (found.forget_us, found.score, found.correlated, found.candidates) == (2_000_000, distance, True, 3)
    assert found.exclusive == "kind"
    usual = specification()
    assert (usual.forget_us, usual.score, usual.correlated, usual.candidates) == (30_000_000, unlikelihood, False, 1)


def test_predict_says_which_model_predicts_what_is_not_seen() -> None:
    roads = roads_of(read_file("examples/roads/town.geojson"), "town")
    assert specification().predictor is None
    assert isinstance(specification(" with predict velocity").predictor, ConstantVelocity)
    assert isinstance(specification(" with predict individual").predictor, HabitualMotion)
    assert isinstance(specification(" with predict roads, max_hyps 2", roads=roads).predictor, AlongRoads)
    assert isinstance(specification(unit="OnRoad", roads=roads).predictor, AlongRoads)
    assert isinstance(specification(" with predict velocity", "OnRoad", roads).predictor, ConstantVelocity)


@pytest.mark.parametrize(
    ("options", "message", "repair"),
    [
        ("forget 0s", "forgotten after 100ms to 24h", "forget 30s"),
        ("forget 1e9h", "forgotten after", ""),
        ("forget soon", "forgotten after", "forget 30s"),
        ("score nearest", "score is likelihood or distance, not nearest", "score"),
        ("predict roades", "not roades", "predict roads"),
        ("max_hyps 0", "from 1 to 64, not 0", "max_hyps 1"),
        ("max_hyps 65", "from 1 to 64", ""),
        ("candidates 1e9", "from 1 to 16", ""),
        ("branches 17", "from 0 to 16", ""),
        ("candidates 3s", "from 1 to 16", ""),
        ("exclusive 3", "exclusive is a word", "exclusive kind"),
        ("errors 3", "errors is a word", "errors independent"),
        ("forgets 3s", "there is no option forgets", "forget"),
        ("least 3", "there is no option least", ""),
        ("score distance, score distance", "given twice", "each option once"),
    ],
)
def test_what_an_option_cannot_be_is_told_where_it_is_read(options, message, repair) -> None:
    with pytest.raises(TextErrors, match=message) as wrong:
        parse_specification(f"{LINK} with {options}")
    (error,) = wrong.value.errors
    assert repair in error.repair
    assert error.column > len(LINK)


def test_predict_roads_needs_roads() -> None:
    with pytest.raises(Exception, match="predict roads needs roads"):
        Camera(PERCEPTS + WORLD.replace("true)", "true) with predict roads"))


def test_an_object_is_forgotten_as_the_link_says() -> None:
    camera = Camera(PERCEPTS + WORLD.rstrip() + " with forget 2s\nstream seen = world\n")
    camera.drive(3100)
    camera.wait(40_000_000)
    last = [sample for name, sample in camera.outputs if name == "seen"][-1]
    assert last.value[-1] is True
    assert 4_500_000 <= last.valid_us <= 5_500_000


def test_what_is_far_is_not_looked_at_where_the_condition_implies_a_distance() -> None:
    gate = gate_of(specification().reestablish, 25.0)
    assert gate is not None
    assert gate.bound_m == 5.0
