"""What is learnt of one object's motion while it is seen predicts it better than what holds for all."""

import math
import random

from dyknow.anchoring.links.individuals import Individual
from dyknow.anchoring.links.prediction import ConstantVelocity, HabitualMotion
from dyknow.anchoring.links.states import ObjectState, diagonal

GAP_S = 4.0


def drive(seed: int) -> list[ObjectState]:
    """A minute of one driver, whose speed goes up and down about a mean, and then the gap."""
    rng = random.Random(seed)
    mean, speed, heading, x, y = rng.uniform(8, 14), 10.0, 0.0, 0.0, 0.0
    states = []
    for number in range(round((60 + GAP_S) * 10)):
        speed += 0.1 * (mean - speed) * 0.4 + rng.gauss(0, 0.8) * math.sqrt(0.1)
        x, y = x + 0.1 * speed * math.cos(heading), y + 0.1 * speed * math.sin(heading)
        state = ObjectState(
            number * 100_000, x, y, speed * math.cos(heading), speed * math.sin(heading), diagonal(0.3, 0.3)
        )
        states.append(state)
    return states


def test_after_a_gap_the_individuals_model_errs_less_than_the_general_one_on_the_same_seeds() -> None:
    general, own = [], []
    for seed in range(150):
        *seen, _ = states = drive(seed)
        cut = len(states) - round(GAP_S * 10)
        individual = Individual()
        for state in seen[:cut]:
            individual.observe(state)
        truth, history = states[-1], states[cut - 10 : cut]
        for errors, model in ((general, ConstantVelocity()), (own, HabitualMotion())):
            found = model.predict(history, truth.valid_us, None, individual).likely
            errors.append(found.distance_m(truth))
    assert sum(own) < 0.95 * sum(general)


def test_habits_are_learnt_from_what_is_seen_and_not_from_gaps() -> None:
    individual = Individual()
    for number in range(100):
        individual.observe(ObjectState(number * 500_000, 5.0 * number, 0.0, 10.0, 0.0, diagonal(0.3, 0.3)))
    assert individual.is_known
    assert abs(individual.speed.mean - 10.0) < 1e-6
    individual.pause()
    individual.observe(ObjectState(900_000_000, 0.0, 0.0, 20.0, 0.0, diagonal(0.3, 0.3)))
    assert abs(individual.speed.mean - 10.0) < 1e-6
    assert individual.speed.latest == individual.speed.mean


def test_before_habits_are_known_the_general_model_predicts() -> None:
    state = ObjectState(0, 0.0, 0.0, 10.0, 0.0, diagonal(0.3, 0.3))
    found = HabitualMotion().predict([state], 2_000_000, None, Individual()).likely
    assert found[:5] == ConstantVelocity().predict([state], 2_000_000).likely[:5]
