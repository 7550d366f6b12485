"""Units are found by name: in modules of a user, the library, and distributions, of which only what is asked for loads."""

import sys
from importlib.metadata import EntryPoint, PathDistribution
from pathlib import Path
from textwrap import dedent
from types import ModuleType

import pytest

from dyknow import SourcePrototype, UnitPrototype, value_unit, variant
from dyknow.compunits import Catalogue, SpeedEst, catalogue, library, load_module, prototypes_of
from dyknow.model.errors import UnitError
from tests.compunits.units import prototype, value_of


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    before = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - before:
        if (getattr(sys.modules[name], "__file__", None) or "").startswith(str(tmp_path)):
            del sys.modules[name]


def write(folder: Path, name: str, text: str) -> str:
    (folder / f"{name}.py").write_text(dedent(text))
    return name


def distribution(folder: Path, name: str, **entries: str) -> list[EntryPoint]:
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = "".join(f"{unit} = {value}\n" for unit, value in entries.items())
    (info / "entry_points.txt").write_text(f"[dyknow.units]\n{lines}")
    return list(PathDistribution(info).entry_points)


ROADS = """
    from dyknow import computational_unit, source, value_unit

    @value_unit("link", "position", name="LinkOf")
    def link_of(position):
        return f"l{position[0]:.0f}"

    @computational_unit("speed", "position")
    class Fast:
        def __call__(self, now_us, sample):
            return 1.0

    @source("position")
    def gps(from_us):
        yield from_us, (1.0, 2.0)
"""


def test_the_library_is_what_the_modules_define() -> None:
    names = set(library())
    assert {"DistanceXY", "DistanceZ", "Distance3D", "SpeedEst", "StabilityFilter", "KalmanPosition"} <= names
    assert {"CovarianceIntersection", "FeetToMetres", "CarRelations", "Behind"} <= names
    assert all(name == each.name and name[0].isupper() for name, each in library().items())
    assert "Conversion" not in names
    for each in library().values():
        assert isinstance(each, UnitPrototype)
        each.make()


def test_a_cheaper_unit_takes_the_same_sorts() -> None:
    cheaper = [(each, library()[each.cheaper]) for each in library().values() if getattr(each, "cheaper", "")]
    assert len(cheaper) >= 3
    for each, other in cheaper:
        assert (each.sort, each.inputs) == (other.sort, other.inputs)


def test_units_of_a_users_module_are_found_by_name(folder) -> None:
    found = Catalogue([load_module(write(folder, "roads", ROADS))])
    link, fast, gps = (found.find(name) for name in ("LinkOf", "Fast", "gps"))
    assert value_of(link, (3.2, 0.0)) == "l3"
    assert (fast.sort, fast.inputs) == ("speed", ("position",))
    assert isinstance(gps, SourcePrototype)
    assert found.find("DistanceXY") is library()["DistanceXY"]
    assert {"LinkOf", "Fast", "gps", "SpeedEst"} <= set(found.names)
    assert list(found.names) == sorted(found.names)


def test_a_users_module_decides_over_the_library(folder) -> None:
    text = """
        from dyknow.compunits import SpeedEst, MovingAverage
        from dyknow import variant

        SPEED = variant(SpeedEst, "Speed2s", seconds=2.0)
        MEAN = variant(MovingAverage, "MovingAverage", "speed", "speed", samples=3)
    """
    found = Catalogue([load_module(write(folder, "mine", text))])
    assert found.find("Speed2s").sort == "speed"
    assert found.find("MovingAverage").sort == "speed"
    assert found.find("SpeedEst") is library()["SpeedEst"], "what a module imported is still what it was"


def test_an_unknown_name_is_told_with_those_that_are_near() -> None:
    with pytest.raises(UnitError, match=r"'SpedEst'.*did you mean 'SpeedEst'"):
        Catalogue(offered=()).find("SpedEst")
    with pytest.raises(UnitError, match="give the module that has it"):
        Catalogue(offered=()).find("os.system")


def test_two_units_of_one_name_are_refused_with_their_places(folder) -> None:
    one = load_module(write(folder, "one", ROADS))
    other = load_module(write(folder, "other", ROADS))
    with pytest.raises(UnitError, match=r"other\.py: 'LinkOf' is also in .*one\.py; give one of them"):
        Catalogue([one, other])
    twice = load_module(write(folder, "twice", ROADS + ROADS.replace("def link_of", "def road_of")))
    with pytest.raises(UnitError, match=r"twice\.py: two units are called 'LinkOf'.*name="):
        prototypes_of(twice)
    assert Catalogue([one, one]).find("LinkOf")


def test_an_entry_point_is_loaded_when_its_name_is_asked_for_and_not_before(folder) -> None:
    write(folder, "roads", ROADS)
    write(folder, "broken", "raise RuntimeError('no camera')")
    offered = distribution(folder, "road-units", LinkOf="roads:link_of", Fast="roads", Camera="broken:Camera")
    found = Catalogue(offered=offered)
    assert {"LinkOf", "Fast", "Camera"} <= set(found.names)
    assert "roads" not in sys.modules
    assert value_of(found.find("LinkOf"), (4.0, 0.0)) == "l4"
    assert found.find("Fast").name == "Fast"
    assert found.find("Fast") is found.find("Fast")
    assert "broken" not in sys.modules
    assert found.offered("LinkOf") is found.find("LinkOf")
    assert found.offered("SpeedEst") is library()["SpeedEst"]
    assert found.offered("nobody's") is None


def test_entry_points_of_what_is_installed_are_read(folder) -> None:
    write(folder, "roads", ROADS)
    distribution(folder, "road-units", LinkOf="roads:link_of")
    assert value_of(Catalogue().find("LinkOf"), (4.0, 0.0)) == "l4"


def test_a_name_that_two_distributions_offer_is_refused_until_one_is_chosen(folder) -> None:
    write(folder, "roads", ROADS)
    write(folder, "streets", ROADS)
    offered = [
        *distribution(folder, "road-units", LinkOf="roads:link_of"),
        *distribution(folder, "street-units", LinkOf="streets:link_of", SpeedEst="streets:Fast"),
    ]
    with pytest.raises(
        UnitError, match=r"'LinkOf' is offered by road-units .* and by street-units .*; give the module"
    ):
        Catalogue(offered=offered).find("LinkOf")
    with pytest.raises(UnitError, match=r"'SpeedEst' is offered by the library and by street-units"):
        Catalogue(offered=offered).find("SpeedEst")
    assert Catalogue([load_module("roads")], offered).find("LinkOf")


BROKEN = [
    ("x = 1\nraise RuntimeError('no camera')", r"broken\.py:2: RuntimeError: no camera; repair it"),
    ("import sys\nsys.exit(3)", r"broken\.py:2: SystemExit: 3"),
    ("def f(:\n", r"broken\.py:1: invalid syntax"),
    ("import not_there_at_all", r"broken\.py:1: it needs 'not_there_at_all', which is not installed; install it"),
    ("1 / 0", r"broken\.py:1: ZeroDivisionError"),
    (
        "from dyknow import value_unit\n\n@value_unit('a')\ndef f(): ...",
        r"broken\.py:3: ValueError: f: .*at least 1 input",
    ),
]


@pytest.mark.parametrize(("text", "told"), BROKEN)
def test_a_module_that_fails_is_told_with_place_cause_and_remedy(folder, text, told) -> None:
    write(folder, "broken", text)
    with pytest.raises(UnitError, match=told):
        load_module("broken")
    offered = distribution(folder, "cameras", Camera="broken:Camera")
    with pytest.raises(UnitError, match=r"'Camera' of cameras \(broken:Camera\): .*" + told):
        Catalogue(offered=offered).find("Camera")


def test_a_module_that_is_not_there_is_told() -> None:
    with pytest.raises(UnitError, match=r"there is no module 'not_there_at_all'; is it installed"):
        load_module("not_there_at_all")
    with pytest.raises(UnitError, match=r"there is no module 'dyknow\.compunits\.not_there'"):
        load_module("dyknow.compunits.not_there")


@pytest.mark.parametrize(("text", "told"), BROKEN)
def test_a_file_that_fails_is_told_as_a_module_is(tmp_path, text, told) -> None:
    write(tmp_path, "broken", text)
    for _ in range(2):
        with pytest.raises(UnitError, match=told):
            load_module(str(tmp_path / "broken.py"))


def test_a_file_is_a_module_of_its_own_whatever_it_is_called(tmp_path) -> None:
    before = sys.modules["json"]
    write(tmp_path, "json", ROADS)
    found = load_module(str(tmp_path / "json.py"))
    assert sys.modules["json"] is before
    assert load_module(str(tmp_path / "json.py")) is found
    assert catalogue([str(tmp_path / "json.py")]).find("LinkOf").sort == "link"


def test_a_file_that_is_not_there_is_told_and_one_that_a_module_lacks_is_its_own_fault(tmp_path) -> None:
    with pytest.raises(UnitError, match="there is no such file"):
        load_module(str(tmp_path / "nowhere.py"))
    write(tmp_path, "careless", "open('/there/is/no/such.toml')")
    with pytest.raises(UnitError, match=r"careless\.py:1: FileNotFoundError: .*such\.toml"):
        load_module(str(tmp_path / "careless.py"))


def test_an_entry_point_that_leads_to_no_unit_is_told(folder) -> None:
    write(folder, "roads", ROADS)
    for value, told in (
        ("roads:nothing", "there is none"),
        ("roads:Fast", "there is Fast"),
        ("roads", "Fast, LinkOf, gps"),
    ):
        offered = [EntryPoint("Road", value, "dyknow.units")]
        with pytest.raises(UnitError, match=rf"'Road' of a distribution .*{told}"):
            Catalogue(offered=offered).find("Road")


def test_sorts_that_stand_for_any_stand_for_the_same_everywhere() -> None:
    fusion, filter_, speed = (prototype(name) for name in ("CovarianceIntersection", "MovingAverage", "SpeedEst"))
    assert filter_.fits("link", ["link"])
    assert not filter_.fits("link", ["road"])
    assert fusion.fits("pos", ["pos", "pos"])
    assert not fusion.fits("pos", ["pos", "speed"])
    assert not fusion.fits("pos", ["pos"])
    assert speed.fits("speed", ["position"])
    assert not speed.fits("speed", ["pos"])


def test_wrong_variants_are_refused_where_they_are_written() -> None:
    assert variant(SpeedEst, "SpeedOf", "speed", "pos").fits("speed", ["pos"])
    with pytest.raises(TypeError, match="secnods"):
        variant(SpeedEst, "Wrong", secnods=1.0)
    with pytest.raises(ValueError, match="seconds"):
        variant(SpeedEst, "Wrong", seconds=-1.0)
    with pytest.raises(ValueError, match="1 inputs"):
        variant(SpeedEst, "Wrong", "speed")
    with pytest.raises(TypeError, match="not a computational unit"):
        variant(len, "Wrong")

    @value_unit("a", "b")
    def plain(value):
        return value

    assert value_of(variant(plain, "Renamed"), 3) == 3
    with pytest.raises(TypeError, match="function and has no settings, got metres"):
        variant(plain, "Wrong", metres=1.0)


def test_sorts_that_are_given_together_are_refused_with_how_they_are_listed(folder: Path) -> None:
    write(
        folder,
        "pairs",
        'from dyknow import value_unit\n\n@value_unit("number", ("number", "number"))\ndef add(a, b):\n    return a + b\n',
    )
    with pytest.raises(UnitError, match=r"not a sort; list the sorts one by one"):
        load_module(str(folder / "pairs.py"))


def test_a_module_without_a_file_is_called_by_its_name() -> None:
    module = ModuleType("typed_in")
    module.one = value_unit("a", "b", name="Same")(lambda value: value)  # type: ignore[attr-defined]
    module.other = value_unit("a", "b", name="Same")(lambda value: value)  # type: ignore[attr-defined]
    with pytest.raises(UnitError, match="typed_in: two units"):
        prototypes_of(module)


def test_what_a_module_says_when_it_fails_is_told_no_longer_than_can_be_read(folder) -> None:
    write(folder, "shouts", "raise KeyError('x' * 100_000)")
    with pytest.raises(UnitError, match="shouts") as told:
        load_module("shouts")
    assert len(str(told.value)) < 1_000
