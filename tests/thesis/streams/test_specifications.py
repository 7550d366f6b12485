"""Sections 4.4.1 to 4.4.4 and 4.5.1 to 4.5.3: the example with two cars, as a signature, as text, and running."""

import pytest

from dyknow import Label, Sample, UnitPrototype, of_values
from dyknow.kpl import parse_specification
from dyknow.kpl.syntax.specification import (
    GeneratorDeclaration,
    Refinement,
    SourceDeclaration,
    StreamDeclaration,
    UnitDeclaration,
)
from dyknow.model.errors import TextErrors
from tests.kpl.instances import Running
from tests.kpl.syntax.test_statements import CARS

MS = 1_000
POS_CAR1 = [(250, 200, "p1"), (325, 300, "p2"), (430, 400, "p3"), (505, 500, "p4")]
POS_CAR2 = [(150, 100, "p6"), (250, 180, "p7"), (480, 400, "p8")]
SPEED_EST = UnitPrototype(
    "SpeedEst", "speed", ("pos",), lambda: of_values(lambda p: p.replace("p", "s")), samplewise=True
)


def cars() -> Running:
    return Running(CARS, prototypes=(SPEED_EST,), sorts={})


def drive(running: Running) -> None:
    arrivals = [("pos_car1", *one) for one in POS_CAR1] + [("pos_car2", *one) for one in POS_CAR2]
    for source, available, valid, value in sorted(arrivals, key=lambda one: one[1]):
        running.instance.push(source, Sample(available * MS, valid * MS, value))


def test_example_4_4_1_the_speeds_of_two_cars_are_estimated() -> None:
    running = cars()
    drive(running)
    found = [(name, sample.valid_us // MS, sample.value) for name, sample in running.outputs]
    assert found == [
        ("speed_car2", 100, "s6"),
        ("speed_car2", 180, "s7"),
        ("speed_car1", 400, "s3"),
        ("speed_car2", 400, "s8"),
    ], "car1 every 200 from 200 on, and of that what is valid from 300 to 400"


def test_example_4_4_2_the_signature_of_the_example() -> None:
    declarations = parse_specification(CARS)
    assert {each.name for each in declarations if isinstance(each, SourceDeclaration)} == {"pos_car1", "pos_car2"}
    units = {(each.name, len(each.inputs)) for each in declarations if isinstance(each, UnitDeclaration)}
    assert units == {("SpeedEst", 1)}
    labels = [each.label for each in declarations if isinstance(each, GeneratorDeclaration)]
    assert {(label.feature, len(label.objects)) for label in labels} == {("pos", 1), ("speed", 1)}
    assert {one for label in labels for one in label.objects} == {"car1", "car2"}
    streams = {each.name for each in declarations if isinstance(each, StreamDeclaration)}
    assert streams == {"speed_car1", "speed_car2"}


def test_example_4_4_3_a_source_declaration() -> None:
    assert SourceDeclaration("pos", "pos_car1") in parse_specification(CARS)
    assert cars().instance.sources() == ("pos_car1", "pos_car2")


def test_example_4_5_2_a_source_provides_samples_of_its_sort() -> None:
    running = cars()
    running.add("stream raw = pos[car1]")
    drive(running)
    assert running.values("raw") == ["p1", "p2", "p3", "p4"]


def test_example_4_4_4_a_unit_has_an_arity() -> None:
    with pytest.raises(TextErrors, match=r"SpeedEst takes 1 stream \(pos\), not 2"):
        cars().add("strmgen speed[both] = SpeedEst(pos[car1], pos[car2])")


def test_example_4_4_5_a_label_is_a_feature_of_objects() -> None:
    assert Label.parse("pos[car1]") == Label("pos", ("car1",))
    assert Label.parse("speed[car2]") == Label("speed", ("car2",))


def test_example_4_4_6_a_primitive_process() -> None:
    running = cars()
    assert running.network.has(Label("pos", ("car1",)))
    assert running.network.process(Label("pos", ("car1",))) is None, "it is fed by its source"


def test_example_4_4_7_a_refinement_process() -> None:
    running = cars()
    (made,) = [
        each.made
        for each in running.instance.specification
        if isinstance(each, GeneratorDeclaration) and each.label == Label("speed", ("car1",))
    ]
    assert isinstance(made, Refinement)
    assert str(made.inputs[0].policy) == "sample every 200"
    (proxy,) = running.network.process(Label("speed", ("car1",))).proxies  # type: ignore[union-attr]
    assert str(proxy.policy) == "sample every 200"


def test_example_4_5_1_the_labels_denote_what_the_sources_provide() -> None:
    running = cars()
    drive(running)
    for car, expected in (("car1", POS_CAR1), ("car2", POS_CAR2)):
        history = running.network.snapshot(Label("pos", (car,)))
        found = [(s.available_us // MS, s.valid_us // MS, s.value) for s in history.get_between(0, 10**6)]
        assert found == expected
    speeds = running.network.snapshot(Label("speed", ("car1",))).get_between(0, 10**6)
    assert [(s.valid_us // MS, s.value) for s in speeds] == [(200, "s1"), (400, "s3")]
