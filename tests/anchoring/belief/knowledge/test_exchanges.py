"""The four exchanges between the pillars; each example fails where its exchange is left out."""

import numpy as np
import pytest

from dyknow.anchoring.belief.files.knowledge import print_known, read_knowledge
from dyknow.anchoring.belief.observations import WorldObservation
from tests.anchoring.belief.knowledge.kitchens import KITCHEN, informed, kinds, kitchen, see
from tests.anchoring.belief.worlds import S


def sizes(model) -> list[str]:
    return [each.name for each in model.environment.query(attribute="size_cm")]


def test_from_prior_knowledge_an_instance_is_completed_by_the_known_one_that_it_is() -> None:
    with_knowledge, without = informed(KITCHEN), informed()
    for model in (with_knowledge, without):
        see(model, 0, 5.1, 4.8, colour="red", type="cup")
    report = see(with_knowledge, 1, 5.1, 4.8, colour="red", type="cup")
    see(without, 1, 5.1, 4.8, colour="red", type="cup")
    assert sizes(without) == []
    assert sizes(with_knowledge) == ["i1"]
    assert with_knowledge.matched == {"i1": "cup-of-anna"}
    cup = with_knowledge.environment.instance(0)
    assert cup.gaussian["size_cm"].mean == pytest.approx([11.0])
    assert cup.type["cup"] > 0.99
    assert report.events[-1].kind == "confirmed"


def test_from_prior_knowledge_a_cup_that_is_not_known_has_what_cups_have() -> None:
    model = informed(KITCHEN)
    report = see(model, 0, -30.0, colour="green", type="cup")
    assert model.matched == {}
    assert ("completed", "i1", "size_cm") in kinds(report)
    assert model.environment.instance(0).gaussian["size_cm"].mean == pytest.approx([8.0])


def test_no_known_instance_is_two_things_at_once() -> None:
    model = informed(KITCHEN)
    see(model, 0, 5.0, 5.0, colour="red", type="cup")
    report = model.on_look(S, "camera", [
        WorldObservation(S, "camera", {"position_m": np.array([x, 5.0]), "colour": "red", "type": "cup"}) for x in (5.0, 7.5)
    ])  # fmt: skip
    assert len(model.environment.table) == 2
    assert list(model.matched.values()) == ["cup-of-anna"]
    assert ("created", "i2", "") in kinds(report)


def leave(model, until_s: float) -> list[str]:
    return [each.kind for each in model.predict_to(round(until_s * S)).events]


def test_back_to_prior_knowledge_a_deleted_cup_is_remembered_and_known_when_it_is_back() -> None:
    model = informed(KITCHEN)
    for t_s in range(3):
        see(model, t_s, -30.0, colour="green", type="cup")
        see(model, t_s, -30.0, sensor="scale", size_cm=np.array([6.0]))
    assert leave(model, 100.0) == ["deleted", "learnt"]
    assert list(model.knowledge.learnt) == ["known-i1"]
    back = see(model, 101.0, -30.2, 0.1, colour="green", type="cup")
    assert ("matched", "i2", "known-i1") in kinds(back)
    remembered = model.environment.instance(0).gaussian["size_cm"].mean[0]
    assert abs(remembered - 6.0) < abs(remembered - 8.0)

    forgetful = informed(KITCHEN.replace("lasting = true", ""))
    for t_s in range(3):
        see(forgetful, t_s, -30.0, colour="green", type="cup")
        see(forgetful, t_s, -30.0, sensor="scale", size_cm=np.array([6.0]))
    assert leave(forgetful, 100.0) == ["deleted"]
    back = see(forgetful, 101.0, -30.2, 0.1, colour="green", type="cup")
    assert forgetful.environment.instance(0).gaussian["size_cm"].mean == pytest.approx([8.0])


def test_back_to_prior_knowledge_a_known_instance_learns_new_values() -> None:
    model = informed(KITCHEN)
    for t_s in range(4):
        see(model, t_s, 5.0, 5.0, colour="red", type="cup")
        see(model, t_s, 5.0, 5.0, sensor="scale", size_cm=np.array([11.3]))
    leave(model, 200.0)
    learnt = model.knowledge.learnt["cup-of-anna"]
    assert learnt.gaussian["position_m"][0] == pytest.approx([5.0, 5.0], abs=0.3)
    assert learnt.categorical["colour"][0] > 0.98
    world = kitchen()
    again = read_knowledge(print_known(learnt, world), world).known[0]
    assert again.name == "cup-of-anna"
    for name, (mean, covariance) in learnt.gaussian.items():
        assert again.gaussian[name][0] == pytest.approx(mean, rel=1e-6)
        assert again.gaussian[name][1] == pytest.approx(covariance, rel=1e-6)


def test_from_the_world_what_is_observed_is_believed_and_nothing_else() -> None:
    watched, blind = informed(KITCHEN), informed(KITCHEN)
    for t_s in range(4):
        see(watched, t_s, 3.0, colour="blue", type="plate")
        blind.predict_to(t_s * S)
    assert [each.name for each in watched.environment.query(type_="plate", min_existence=0.9)] == ["i1"]
    assert blind.environment.query() == []


def test_to_the_world_requests_keep_alive_what_nobody_would_look_at() -> None:
    """A camera that looks where it is asked to, in a kitchen with a cup that is never in view by itself."""

    def lives(answers: bool) -> bool:
        model = informed(KITCHEN, model=kitchen(lifetime_s=10.0))
        for t_s in range(3):
            see(model, t_s, -30.0, colour="green", type="cup")
        for t_s in range(3, 60):
            model.predict_to(t_s * S)
            asked = [each for each in model.requests() if each.what == "existence"]
            if answers and asked:
                assert asked[0].sensor in {"camera", "scale"}
                assert asked[0].place_m == pytest.approx((-30.0, 0.0), abs=1.0)
                see(model, t_s, -30.0, colour="green")
        return bool(model.environment.query())

    assert lives(answers=True)
    assert not lives(answers=False)


def test_to_the_world_a_gap_is_asked_for_of_the_sensor_that_can_fill_it() -> None:
    text = KITCHEN.replace("attributes.size_cm = { mean = [8.0], sd = 1.0 }\n", "")
    model = informed(text)
    for t_s in range(3):
        see(model, t_s, -30.0, colour="green", type="cup")
    asked = [(each.what, each.sensor, each.because) for each in model.requests()]
    assert asked == [("size_cm", "scale", "each cup has size_cm")]
    see(model, 3, -30.0, sensor="scale", size_cm=np.array([6.0]))
    assert [each.what for each in model.requests()] == []
    untold = informed()
    for t_s in range(3):
        see(untold, t_s, -30.0, colour="green", type="cup")
    assert untold.requests() == []
