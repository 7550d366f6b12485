"""Prediction, update and life cycle of instances."""

from dataclasses import replace
from math import exp, log

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.anchoring.belief.description import (
    GaussianAttribute,
    InitialInstance,
    LifeThresholds,
    ObjectTypes,
    RelationKind,
    WorldLimits,
    WorldModel,
    WorldSensor,
    uniform,
)
from dyknow.anchoring.belief.environment import EnvironmentModel
from dyknow.anchoring.belief.observations import ReportedRelation, WorldObservation
from tests.anchoring.belief import enumeration
from tests.anchoring.belief.worlds import COLOURS, S, position, seen, sensor, world


def believed(name: str, x_m: float, sd_m: float = 1.0, existence: float = 0.9, **categorical: list) -> InitialInstance:
    return InitialInstance(
        name, existence, {"position_m": (np.array([x_m, 0.0]), sd_m**2 * np.eye(2))},
        {key: np.array(shares) for key, shares in categorical.items()},
    )  # fmt: skip


def kinds(environment_report) -> list[tuple[str, str]]:
    return [(each.kind, each.instance) for each in environment_report.events]


def normal(difference: np.ndarray, covariance: np.ndarray) -> float:
    exponent = -0.5 * difference @ np.linalg.solve(covariance, difference)
    return float(np.exp(exponent) / np.sqrt(np.linalg.det(2.0 * np.pi * covariance)))


@pytest.mark.parametrize("reading", ["event", "share"])
@given(seed=st.integers(0, 2**32), count=st.integers(1, 4))
def test_an_update_is_the_mixture_over_all_associations_with_its_moments_matched(
    reading: str, seed: int, count: int
) -> None:
    rng = np.random.default_rng(seed)
    shares, types = rng.dirichlet(np.ones(3), count), rng.dirichlet(np.ones(2), count)
    initial = [
        believed(
            f"i{i}", float(rng.normal(0, 2)), float(rng.uniform(0.3, 2)), float(rng.uniform(0.2, 0.99)),
            colour=shares[i], type=types[i],
        )
        for i in range(count)
    ]  # fmt: skip
    p_m = {frozenset({"position_m", "colour"}): np.array([0.4, 0.1])}
    model = world(
        sensor(detects=0.7, false_alarm=0.05, births=0.2, clutter=0.5),
        types=ObjectTypes(uniform("type", ("car", "pedestrian")), p_m),
        reading=reading, initial=initial, thresholds=LifeThresholds(0.999, 0.9999, 1e-12),
    )  # fmt: skip
    environment = EnvironmentModel(model, 0)
    report = environment.observe(seen(0, 0.5, 0.3, colour="red"))

    confusion, noise, y = model.sensors["camera"].confusion["colour"].matrix, 0.25 * np.eye(2), np.array([0.5, 0.3])
    likelihood = []
    for i, each in enumerate(initial):
        mean, covariance = each.gaussian["position_m"]
        of_type = types[i] @ p_m[frozenset({"position_m", "colour"})]
        likelihood.append(normal(y - mean, covariance + noise) * (shares[i] @ confusion[:, 0]) * of_type)
    density = 1e-4 / 3.0 * 0.25
    expected = enumeration.single(
        reading, [each.existence for each in initial], likelihood, [0.7] * count, [0.05] * count, 0.2, density, 0.5, density
    )  # fmt: skip
    assert report.associations[0]["new"] == pytest.approx(expected.birth, abs=1e-9)
    assert environment.table.existence == pytest.approx(expected.existence, abs=1e-9)
    for i, each in enumerate(initial):
        mean, covariance = each.gaussian["position_m"]
        gain = covariance @ np.linalg.inv(covariance + noise)
        component = expected.weights[i], mean + gain @ (y - mean), covariance - gain @ covariance
        mixed_mean, mixed_covariance = enumeration.mixture(mean, covariance, [component])
        view = environment.instance(i)
        assert view.gaussian["position_m"].mean == pytest.approx(mixed_mean, abs=1e-9)
        assert view.gaussian["position_m"].covariance == pytest.approx(mixed_covariance, abs=1e-9)
        updated = shares[i] * confusion[:, 0] / (shares[i] @ confusion[:, 0])
        mixed = (1 - expected.weights[i]) * shares[i] + expected.weights[i] * updated
        assert list(view.categorical["colour"].values()) == pytest.approx(mixed, abs=1e-9)
        of_type = types[i] * [0.4, 0.1] / (types[i] @ [0.4, 0.1])
        mixed = (1 - expected.weights[i]) * types[i] + expected.weights[i] * of_type
        assert list(view.type.values()) == pytest.approx(mixed, abs=1e-9)


@given(seed=st.integers(0, 2**32))
def test_a_scan_is_the_mixture_over_all_associations_with_its_moments_matched(seed: int) -> None:
    rng = np.random.default_rng(seed)
    initial = [believed(f"i{i}", float(rng.normal(0, 1.5)), float(rng.uniform(0.5, 2)), 0.7) for i in range(3)]
    model = world(
        sensor(detects=0.8, births=0.3, clutter=1.5),
        initial=initial, thresholds=LifeThresholds(0.999, 0.9999, 1e-12),
    )  # fmt: skip
    environment = EnvironmentModel(model, 0)
    places = rng.normal(0, 1.0, (3, 2))
    report = environment.observe_scan([seen(0, *place) for place in places])
    noise = 0.25 * np.eye(2)
    likelihood = np.array(
        [[normal(y - mean, covariance + noise) for y in places] for mean, covariance in (each.gaussian["position_m"] for each in initial)]
    )  # fmt: skip
    intensity = np.full(3, 1e-4)
    pairs, existence, born = enumeration.scan([0.7] * 3, [0.8] * 3, likelihood, 0.3 * intensity, 1.5 * intensity)
    assert report.is_exact
    assert report.births == pytest.approx(born, abs=1e-9)
    assert environment.table.existence == pytest.approx(existence, abs=1e-9)
    for i, each in enumerate(initial):
        mean, covariance = each.gaussian["position_m"]
        gain = covariance @ np.linalg.inv(covariance + noise)
        components = [
            (pairs[i, j] / existence[i], mean + gain @ (places[j] - mean), covariance - gain @ covariance)
            for j in range(3)
        ]
        mixed_mean, mixed_covariance = enumeration.mixture(mean, covariance, components)
        assert environment.instance(i).gaussian["position_m"].mean == pytest.approx(mixed_mean, abs=1e-5)
        assert environment.instance(i).gaussian["position_m"].covariance == pytest.approx(mixed_covariance, abs=1e-4)


@given(seed=st.integers(0, 2**32), clutter=st.sampled_from([0.0, 0.3]))
def test_a_scan_of_more_observations_than_instances_is_exact_also_far_from_what_is_expected(
    seed: int, clutter: float
) -> None:
    """Up to tens of deviations away, one of them beyond the region: without clutter only an instance can have given it."""
    rng = np.random.default_rng(seed)
    initial = [believed(f"i{i}", float(rng.normal(0, 9)), float(rng.uniform(0.3, 2)), 0.6) for i in range(3)]
    model = world(
        sensor(detects=0.8, births=0.2, clutter=clutter), initial=initial, place=position(side_m=20.0),
        thresholds=LifeThresholds(0.999, 0.9999, 1e-12),
    )  # fmt: skip
    environment = EnvironmentModel(model, 0)
    places = np.concatenate((rng.uniform(-10.0, 10.0, (4, 2)), rng.normal(0, 12.0, (1, 2))))
    report = environment.observe_scan([seen(0, *place) for place in places])
    noise = 0.25 * np.eye(2)
    likelihood = np.array(
        [[normal(y - mean, covariance + noise) for y in places] for mean, covariance in (each.gaussian["position_m"] for each in initial)]
    )  # fmt: skip
    is_inside = (np.abs(places) <= 10.0).all(axis=1)
    with np.errstate(invalid="ignore"):
        pairs, existence, born = enumeration.scan(
            [0.6] * 3, [0.8] * 3, likelihood, 0.2 / 400.0 * is_inside, np.full(5, clutter / 400.0)
        )
    if np.isfinite(existence).all():
        assert report.is_exact
        found = np.zeros((3, 5))
        found[report.rows, report.cols] = report.pairs
        assert found == pytest.approx(pairs, abs=1e-9)
        assert report.existence == pytest.approx(existence, abs=1e-9)
        assert report.births == pytest.approx(born, abs=1e-9)


def test_figure_5_existence_decays_jumps_up_where_the_entity_is_observed_again_and_ends_when_it_is_said_to() -> None:
    clutter = WorldSensor("camera", 0.9, 0.01, 0.0, 0.1, {"position_m": 0.25 * np.eye(2)})
    model = world(
        clutter, kept_per_s=0.9, initial=[believed("i1", 0.0, 0.5, 0.5)], thresholds=LifeThresholds(0.2, 0.8, 0.1)
    )
    environment = EnvironmentModel(model, 0)
    course = []
    for step in range(221):
        t_s = step / 10.0
        if t_s in {6.0, 10.5}:
            before = environment.predict_to(round(t_s * S)).existence[0]
            environment.observe(seen(t_s, 0.1))
            assert environment.table.existence[0] > before + 0.1
        else:
            environment.predict_to(round(t_s * S))
        course.append(float(environment.table.existence[0]))
    assert course[59] == pytest.approx(0.5 * 0.9**5.9, abs=1e-9)
    assert course[104] == pytest.approx(course[60] * 0.9**4.4, abs=1e-9)
    assert course[220] == pytest.approx(course[105] * 0.9**11.5, abs=1e-9)
    assert min(course) > 0.1
    ends_s = 10.5 + log(course[105] / 0.1) / -log(0.9)
    assert environment.deadline_us == pytest.approx(ends_s * S, abs=2)
    report = environment.predict_to(60 * S)
    assert report.deleted == ["i1"]
    assert report.events[0].valid_us == pytest.approx(ends_s * S, abs=2)
    assert environment.deadline_us == float("inf")


def test_figure_2_between_the_two_thresholds_an_instance_stays_what_it_was() -> None:
    glance = sensor(detects=0.5, false_alarm=0.05, births=0.3, clutter=0.5)
    model = world(glance, kept_per_s=0.9, thresholds=LifeThresholds(0.2, 0.8, 0.3))
    environment = EnvironmentModel(model)
    assert kinds(environment.observe(seen(0, 0.0))) == [("created", "i1")]
    assert environment.instance(0).status == "tentative"
    assert kinds(environment.observe(seen(1, 0.0))) == [("confirmed", "i1")]
    between = round(S * (1 + log(environment.table.existence[0] / 0.5) / -log(0.9)))
    assert kinds(environment.predict_to(between)) == []
    assert 0.3 < environment.table.existence[0] < 0.8
    assert environment.instance(0).status == "confirmed"
    assert kinds(environment.observe(WorldObservation(between, "camera", {"position_m": np.zeros(2)}))) == []
    assert kinds(environment.predict_to(60 * S)) == [("deleted", "i1")]
    report = environment.observe(seen(61, 0.0))
    assert kinds(report) == [("created", "i2")]
    assert environment.instance(0).status == "tentative"


def cup_world(ageing_s: float = 60.0) -> WorldModel:
    """The example of Figure 4: an instance of a cup, and observations of its colour and position."""
    colour = uniform("colour", ("red", "blue"), ageing_s=ageing_s, create=0.7, drop=0.6)
    names = ("cup", "plate")
    by_set = {
        frozenset({"colour", "position_m"}): np.array([0.4, 0.1]),
        frozenset({"colour"}): np.array([0.3, 0.0]),
        frozenset({"position_m"}): np.array([0.3, 0.9]),
    }
    types = ObjectTypes(uniform("type", names), by_set, least=0.0)
    from dyknow.anchoring.belief.description import Confusion

    shades = Confusion(("red", "dark red", "blue"), np.array([[0.6, 0.3, 0.1], [0.05, 0.05, 0.9]]))
    camera = WorldSensor(
        "camera", 0.9, 0.01, 0.1, 0.1, {"position_m": 4.0 * np.eye(2)}, {"colour": shades},
    )  # fmt: skip
    size = GaussianAttribute("size_cm", mean=np.array([10.0]), sd=np.array([4.0]), create_sd=2.0, drop_sd=3.0)
    cup = InitialInstance(
        "i3",
        0.9,
        {"position_m": (np.array([5.0, 20.0]), 4.0 * np.eye(2)), "size_cm": (np.array([5.0]), np.array([[0.25]]))},
        {"type": np.array([0.8, 0.2]), "colour": np.array([0.9, 0.1])},
    )
    relations = (RelationKind("on", ageing_s=30.0),)
    return WorldModel(types, [position(), size], [colour], relations, {"camera": camera}, initial=[cup], lifetime_s=1e6)


def test_figure_4_a_dark_red_thing_at_7_18_is_the_red_cup_at_5_20() -> None:
    environment = EnvironmentModel(cup_world(), 0)
    observation = WorldObservation(0, "camera", {"colour": "dark red", "position_m": np.array([7.0, 18.0])})
    report = environment.observe(observation)
    spread = 8.0 * np.eye(2)
    colour, of_type = 0.9 * 0.3 + 0.1 * 0.05, 0.8 * 0.4 + 0.2 * 0.1
    likelihood = normal(np.array([2.0, -2.0]), spread) * colour * of_type
    density = 1e-4 * 0.5 * (0.5 * 0.4 + 0.5 * 0.1)
    expected = enumeration.single("event", [0.9], [likelihood], [0.9], [0.01], 0.1, density, 0.1, density)
    assert report.associations[0]["i3"] == pytest.approx(expected.instances[0], abs=1e-9)
    cup = environment.instance(0)
    w = expected.weights[0]
    assert cup.gaussian["position_m"].mean == pytest.approx([5.0 + w, 20.0 - w], abs=1e-9)
    assert cup.type["cup"] == pytest.approx((1 - w) * 0.8 + w * 0.32 / 0.34, abs=1e-9)
    assert cup.categorical["colour"]["red"] == pytest.approx((1 - w) * 0.9 + w * 0.27 / colour, abs=1e-9)
    assert cup.gaussian["size_cm"].mean == pytest.approx([5.0])


def test_figure_4_only_its_type_says_which_attributes_are_observed_of_a_cup() -> None:
    for values, share in (({"colour": "red"}, 1.0), ({"position_m": np.array([5.0, 20.0])}, 0.8 * 0.3 / 0.42)):
        environment = EnvironmentModel(cup_world(), 0)
        report = environment.observe(WorldObservation(0, "camera", values))
        w = report.associations[0]["i3"] / environment.table.existence[0]
        assert environment.instance(0).type["cup"] == pytest.approx((1 - w) * 0.8 + w * share, abs=0.02)


def test_what_the_type_of_an_instance_excludes_is_not_of_that_instance() -> None:
    model = cup_world()
    plate = InitialInstance(
        "i1", 0.9, {"position_m": (np.array([5.0, 20.0]), np.eye(2))}, {"type": np.array([0.0, 1.0])}
    )
    blind = replace(model.sensors["camera"], births=0.0, clutter=0.0, false_alarm=0.0)
    environment = EnvironmentModel(replace(model, initial=[plate], sensors={"camera": blind}), 0)
    for _ in range(2):
        report = environment.observe(WorldObservation(0, "camera", {"colour": "red"}))
        assert report.is_unexplained  # the colour alone is never observed of a plate
        assert environment.instance(0).type["plate"] == 1.0
        environment.observe_scan([WorldObservation(0, "camera", {"colour": "red"})])
        assert environment.instance(0).type["plate"] == 1.0


def entropy(shares) -> float:
    return -sum(each * log(each) for each in shares.values() if each > 0.0)


def test_the_colour_of_a_cup_that_is_not_seen_becomes_unknown_and_is_dropped_and_created_again_with_hysteresis() -> (
    None
):
    environment = EnvironmentModel(cup_world(), 0)
    before, events, course = 0.0, [], []
    for t_s in range(0, 200, 2):
        events += environment.predict_to(t_s * S).events
        view = environment.instance(0)
        course.append("colour" in view.categorical)
        if "colour" in view.categorical:
            assert entropy(view.categorical["colour"]) > before or t_s == 0
            before = entropy(view.categorical["colour"])
            red = 0.5 + 0.4 * exp(-t_s / 60.0)
            assert view.categorical["colour"]["red"] == pytest.approx(red, abs=1e-9)
    assert [(each.kind, each.what) for each in events] == [("attribute-dropped", "colour")]
    assert events[0].valid_us == pytest.approx(60 * log(0.4 / 0.1) * S, abs=2 * S)
    assert course == sorted(course, reverse=True)
    created = environment.observe(
        WorldObservation(200 * S, "camera", {"colour": "red", "position_m": np.array([5.0, 20.0])})
    )
    assert ("attribute-created", "colour") in [(each.kind, each.what) for each in created.events]


def test_the_size_of_a_cup_is_created_when_it_is_known_well_enough() -> None:
    model = cup_world()
    scale = WorldSensor("scale", 0.9, 0.01, 0.1, 0.1, {"size_cm": np.array([[9.0]]), "position_m": np.eye(2)})
    model = WorldModel(
        ObjectTypes(uniform("type", ("cup", "plate"))), model.gaussian, model.categorical, (), {"scale": scale},
        initial=[InitialInstance("i3", 0.99, {"position_m": (np.zeros(2), np.eye(2))})],
    )  # fmt: skip
    environment = EnvironmentModel(model, 0)
    events = []
    for t_s in range(4):
        values = {"position_m": np.zeros(2), "size_cm": np.array([5.0])}
        report = environment.observe(WorldObservation(t_s * S, "scale", values))
        events.append([each.what for each in report.events if each.kind == "attribute-created"])
    assert events == [[], ["size_cm"], [], []]  # 1 / (1/16 + 1/9) > 4, 1 / (1/16 + 2/9) < 4


def test_a_relation_is_created_ages_is_dropped_and_ends_with_either_of_its_instances() -> None:
    model = world(
        sensor(detects=0.2, false_alarm=1e-3), relations=(RelationKind("on", ageing_s=10.0),), kept_per_s=0.999,
        initial=[believed("cup", 0.0), believed("table", 20.0)],
    )  # fmt: skip
    environment = EnvironmentModel(model, 0)
    on = (ReportedRelation("on", "table"),)
    events = [*environment.observe(seen(0, 0.0, relations=on)).events]
    assert environment.query()[0].relations == {}
    events += environment.observe(seen(1, 0.0, relations=on)).events
    probability = environment.instance(0).relations["on", "table"]
    assert probability > 0.8
    assert environment.instance(1).relations == {}
    events += environment.predict_to(60 * S).events
    assert [(each.kind, each.instance, each.what) for each in events if "relation" in each.kind] == [
        ("relation-created", "cup", "on table"),
        ("relation-dropped", "cup", "on table"),
    ]
    dropped_s = 1.0 + 10.0 * log((probability - 0.5) / 0.1)
    assert events[-1].valid_us == pytest.approx(dropped_s * S, abs=2)
    in_the_end = environment.query()[0].existence
    assert events[-1].existence == pytest.approx(in_the_end * 0.999 ** (dropped_s - 60.0))
    assert [each.existence > 0.9 for each in events if "relation" in each.kind] == [True, True]

    for t_s in (61, 62):
        environment.observe(seen(t_s, 0.0, relations=on))
    assert ("on", "table") in environment.instance(0).relations
    ended = environment.predict_to(100_000 * S)
    assert ("relation-dropped", "cup") in kinds(ended)
    assert all(each.existence > 0.0 for each in ended.events), "also of instances that were deleted later"


def test_reports_that_it_does_not_hold_drop_a_relation_and_tell_alike_things_apart() -> None:
    initial = [believed("one", 0.0), believed("two", 0.5), believed("table", 20.0)]
    glance = sensor(detects=0.1, false_alarm=1e-3)
    model = world(glance, relations=(RelationKind("on", prior=0.3),), initial=initial)
    environment = EnvironmentModel(model, 0)
    on, off = (ReportedRelation("on", "table"),), (ReportedRelation("on", "table", holds=False),)
    for t_s in range(4):
        environment.observe(seen(t_s, 0.0, relations=on, colour="red"))
    assert environment.instance(0).relations["on", "table"] > 0.9
    report = environment.observe(seen(5, 0.25, relations=off))
    assert report.associations[0]["two"] > report.associations[0]["one"]
    for t_s in range(6, 12):
        environment.observe(seen(t_s, 0.0, relations=off, colour="red"))
    assert environment.instance(0).relations == {}
    unknown = environment.observe(seen(12, 0.0, relations=(ReportedRelation("on", "nothing"),)))
    assert [each.because for each in unknown.events] == ["no instance nothing"]
    assert environment.counts["unknown-instance"] == 1


def test_what_nothing_explains_changes_nothing_and_is_counted() -> None:
    model = world(WorldSensor("camera", 0.9, 0.01, 0.1, 0.0), initial=[])
    environment = EnvironmentModel(model, 0)
    report = environment.observe(seen(0, 1000.0))
    assert report.is_unexplained
    assert environment.counts["unexplained"] == 1
    assert len(environment.table) == 0
    assert environment.observe_scan([seen(0, 1000.0), seen(0, 0.0)]).is_unexplained


def test_time_that_goes_backwards_is_refused_and_counted_and_no_time_changes_nothing() -> None:
    environment = EnvironmentModel(world(kept_per_s=0.9), 0)
    environment.observe(seen(5, 0.0))
    before = environment.table.existence.copy()
    assert kinds(environment.observe(seen(4, 0.0))) == [("late", "")]
    assert kinds(environment.observe_scan([seen(4, 0.0), seen(4, 1.0)])) == [("late", "")]
    assert kinds(environment.predict_to(4 * S)) == [("late", "")]
    assert environment.counts["late"] == 3
    assert (environment.table.existence == before).all()
    assert environment.predict_to(5 * S).events == ()
    assert (environment.table.existence == before).all()


def test_more_instances_observations_and_pairs_than_allowed_are_told() -> None:
    small = world(sensor(births=1.0, clutter=0.1), limits=WorldLimits(instances=5, scan=8, pairs=4))
    environment = EnvironmentModel(small)
    report = environment.observe_scan([seen(0, 8.0 * i) for i in range(-5, 5)])
    assert len(environment.table) == 5
    assert len(report.births) == 8
    assert [each.kind for each in report.events].count("limited") == 2
    crowded = environment.observe_scan([seen(1, -40.0 + 0.01 * i) for i in range(8)])
    assert not crowded.is_exact
    assert environment.counts["limited"] >= 3
    assert len(environment.table) == 5


@given(seed=st.integers(0, 1000))
def test_what_a_model_says_of_instances_does_not_depend_on_their_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    initial = [believed(f"a{i}", float(rng.normal(0, 3)), 1.0, float(rng.uniform(0.3, 0.9))) for i in range(5)]
    order = rng.permutation(5)
    scan = [seen(1, float(x)) for x in rng.normal(0, 3, 4)]
    found = []
    for listed in (initial, [initial[i] for i in order]):
        environment = EnvironmentModel(world(initial=listed, kept_per_s=0.95), 0)
        environment.observe_scan(scan)
        environment.observe(seen(2, 1.0))
        found.append({each.name: each for each in environment.query()})
    assert found[0].keys() == found[1].keys()
    for name, one in found[0].items():
        assert one.existence == pytest.approx(found[1][name].existence, abs=1e-6)


@given(seed=st.integers(0, 1000))
def test_beliefs_stay_beliefs_over_many_updates(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model = world(
        sensor(births=0.5, clutter=0.5), kept_per_s=0.8, place=position(2, 1.0, 20.0), relations=(RelationKind("on"),)
    )
    environment = EnvironmentModel(model)
    for t in range(30):
        scan = [seen(t, *rng.uniform(-10, 10, 2), colour=COLOURS[rng.integers(3)]) for _ in range(rng.integers(0, 4))]
        environment.on_look(t * S, "camera", scan)
        table = environment.table
        assert ((table.existence >= 0.05) & (table.existence <= 1.0)).all()
        covariance = table.gaussian["position_m"].covariance
        if len(covariance):
            assert np.linalg.eigvalsh(covariance).min() > 0.0
        assert table.categorical["colour"].shares.sum(axis=1) == pytest.approx(np.ones(len(table)))
    assert len({*table.names}) == len(table)


def test_estimates_are_as_far_off_as_they_say() -> None:
    """Normalised squared errors of a tracked thing in clutter average the number of its dimensions."""
    rng = np.random.default_rng(1)
    errors = []
    for _ in range(40):
        model = world(sensor(detects=0.9, births=0.0, clutter=2.0), place=position(2, 0.5), initial=[
            InitialInstance("i1", 0.99, {"position_m": (np.zeros(4), np.diag([1.0, 1.0, 4.0, 4.0]))})
        ])  # fmt: skip
        environment = EnvironmentModel(model, 0)
        state = rng.multivariate_normal(np.zeros(4), np.diag([1.0, 1.0, 4.0, 4.0]))
        for t in range(1, 16):
            block = np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]]) * 0.5
            noise = rng.multivariate_normal(np.zeros(4), np.kron(block, np.eye(2)))
            state = np.kron([[1.0, 1.0], [0.0, 1.0]], np.eye(2)) @ state + noise
            scan = [seen(t, *(state[:2] + rng.normal(0, 0.5, 2)))] if rng.random() < 0.9 else []
            scan += [seen(t, *rng.uniform(-50, 50, 2)) for _ in range(rng.poisson(2.0))]
            environment.on_look(t * S, "camera", scan) if len(scan) != 1 else environment.observe_scan(scan)
            belief = environment.instance(0).gaussian["position_m"]
            difference = state - belief.mean
            errors.append(difference @ np.linalg.solve(belief.covariance, difference))
    assert 3.0 < np.median(errors) * 4.0 / 3.36 < 5.0  # the median of chi^2 with 4 degrees of freedom is 3.36


def test_angles_are_compared_around_the_circle() -> None:
    heading = GaussianAttribute("heading_rad", mean=np.zeros(1), sd=np.full(1, 3.0), is_angle=True)
    model = WorldModel(
        ObjectTypes(uniform("type", ("car",))), [heading], [], (),
        {"compass": WorldSensor("compass", 0.9, 0.01, 0.0, 0.1, {"heading_rad": np.array([[0.01]])})},
        initial=[InitialInstance("i1", 0.99, {"heading_rad": (np.array([3.1]), np.array([[0.01]]))})],
    )  # fmt: skip
    environment = EnvironmentModel(model, 0)
    report = environment.observe(WorldObservation(0, "compass", {"heading_rad": np.array([-3.1])}))
    assert report.associations[0]["i1"] > 0.9
    assert abs(environment.instance(0).gaussian["heading_rad"].mean[0]) == pytest.approx(np.pi, abs=0.05)


def test_a_query_is_by_type_attribute_and_existence() -> None:
    initial = [
        believed("one", 0.0, type=[0.9, 0.1]), believed("two", 9.0, type=[0.2, 0.8]), believed("three", 20.0, existence=0.3)
    ]  # fmt: skip
    environment = EnvironmentModel(world(initial=initial, colour=uniform("colour", COLOURS, create=0.7, drop=0.5)), 0)
    assert [each.name for each in environment.query(type_="pedestrian")] == ["two"]
    assert [each.name for each in environment.query(min_existence=0.5)] == ["one", "two"]
    assert environment.query(attribute="colour") == []
    environment.observe(seen(0, 0.0, colour="red"))
    assert [each.name for each in environment.query(attribute="colour")] == ["one"]


def test_what_is_out_of_view_does_not_lose_existence_by_not_being_seen() -> None:
    window = np.array([[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]])
    initial = [believed("in", 0.0, 0.5), believed("border", 5.0, 0.5), believed("out", 30.0, 0.5)]
    environment = EnvironmentModel(world(sensor(view_m=window), initial=initial), 0)
    inside, border, outside = environment.on_look(S, "camera", []).existence
    assert inside == pytest.approx(0.9 * 0.1 / (1 - 0.81), abs=1e-9)
    assert inside < border < outside
    assert outside == pytest.approx(0.9, abs=1e-6)


def test_a_look_that_finds_nothing_is_taken_where_types_are_known_by_what_is_observed_of_them() -> None:
    types = ObjectTypes(uniform("type", ("car", "pedestrian")), {frozenset({"position_m"}): np.array([0.9, 0.4])})
    environment = EnvironmentModel(world(sensor(births=0.5, clutter=0.1), types=types))
    seen = WorldObservation(0, "camera", {"position_m": np.zeros(2)})
    before = environment.observe_scan([seen, seen._replace(values={"position_m": np.full(2, 30.0)})])
    assert len(before.created) == 2
    environment.on_look(S, "camera", [])
    assert (environment.table.existence < 0.5).all()
