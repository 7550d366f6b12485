"""Where objects that no percept shows are: the interface of predictors, and constant velocity.

A `Predictor` is a function of the states of an object while it was seen, of the time to predict to, and of its
prediction for the time before. It returns a `ObjectPrediction`: one or several hypotheses with weights, under one
symbol. A predictor along roads puts one hypothesis per route there, the heaviest first, and the route into the
attributes of its state.

    class AlongRoads:
        def predict(self, history, to_us, before=None, individual=None) -> ObjectPrediction: ...

Implementations are pure: `before` holds their memory from tick to tick.
"""

from collections.abc import Sequence
from math import atan2, cos, sin
from typing import NamedTuple, Protocol

import numpy as np

from dyknow import US_PER_S
from dyknow.anchoring.links.individuals import Individual
from dyknow.anchoring.links.states import Attributes, ObjectState, moved


class Hypothesis(NamedTuple):
    """A state an object may have, and how probable that is."""

    state: ObjectState
    weight: float


class ObjectPrediction(NamedTuple):
    """All states an object may have at one time, the most probable first; the weights sum to 1."""

    hypotheses: tuple[Hypothesis, ...]

    @property
    def likely(self) -> ObjectState:
        """The most probable state."""
        return self.hypotheses[0].state

    def nearest(self, state: ObjectState) -> ObjectState:
        """The state that lies nearest to another; of two as near, the more probable."""
        if len(self.hypotheses) == 1:
            return self.hypotheses[0].state
        return min((each.state for each in self.hypotheses), key=state.distance_m)

    def described(self, attributes: Attributes) -> "ObjectPrediction":
        """The same places of an object with other attributes."""
        return ObjectPrediction(
            tuple(Hypothesis(each.state._replace(attributes=attributes), each.weight) for each in self.hypotheses)
        )


class Predictor(Protocol):
    """Predicts objects of one type while they are not linked to what shows them."""

    def predict(
        self,
        history: Sequence[ObjectState],
        to_us: int,
        before: ObjectPrediction | None = None,
        individual: Individual | None = None,
    ) -> ObjectPrediction:
        """The hypotheses for `to_us`.

        Args:
            history: the latest states while it was seen, oldest first, at least one; no covariance of them grows.
            to_us: not before the last of them, and not before the time of `before`.
            before: the last prediction from this same history; None at the first time.
            individual: the learnt motion of this object; None: predict as for any of its type.
        """


def certain(state: ObjectState) -> ObjectPrediction:
    """A prediction with one hypothesis."""
    return ObjectPrediction((Hypothesis(state, 1.0),))


class ConstantVelocity:
    """The general model: the line through the last states, by least squares over time.

    The covariance is that of the last state, grown with white acceleration noise.

    Args:
        states: how many of the last states the line goes through.
        noise: density of the acceleration noise, m^2/s^3.
    """

    def __init__(self, states: int = 5, noise: float = 2.0) -> None:
        self._states, self._noise = states, noise

    def predict(
        self,
        history: Sequence[ObjectState],
        to_us: int,
        before: ObjectPrediction | None = None,
        individual: Individual | None = None,  # noqa: ARG002
    ) -> ObjectPrediction:
        last = history[-1]
        if before is not None:
            vx_m_s, vy_m_s = before.likely.vx_m_s, before.likely.vy_m_s
        else:
            vx_m_s, vy_m_s = _slope(history[-self._states :])
        return certain(moved(last._replace(vx_m_s=vx_m_s, vy_m_s=vy_m_s), to_us, self._noise))


def _slope(history: Sequence[ObjectState]) -> tuple[float, float]:
    """Velocity of the least-squares line through the positions; of states of one instant, as two sensors give, that of the last."""
    last = history[-1]
    if history[0].valid_us == last.valid_us:
        return last.vx_m_s, last.vy_m_s
    seconds = np.array([(each.valid_us - last.valid_us) / US_PER_S for each in history])
    places = np.array([each[1:3] for each in history])
    seconds -= seconds.mean()
    slope = seconds @ (places - places.mean(axis=0)) / (seconds @ seconds)
    return float(slope[0]), float(slope[1])


class HabitualMotion:
    """The individual's model: speed and turn rate return to the usual ones of this object; else the general one.

    Args:
        general: for objects whose habits are not known yet; its covariance is used for all.
        step_s: of the integration.
    """

    def __init__(self, general: ConstantVelocity | None = None, step_s: float = 0.1) -> None:
        self._general, self._step_s = general or ConstantVelocity(), step_s

    def predict(
        self,
        history: Sequence[ObjectState],
        to_us: int,
        before: ObjectPrediction | None = None,
        individual: Individual | None = None,
    ) -> ObjectPrediction:
        last, general = history[-1], self._general.predict(history, to_us)
        if individual is None or not individual.is_known or to_us == last.valid_us:
            return general if before is None else self._general.predict(history, to_us, before)
        seconds = (to_us - last.valid_us) / US_PER_S
        steps = max(1, round(seconds / self._step_s))
        x_m, y_m, heading, speed = last.x_m, last.y_m, atan2(last.vy_m_s, last.vx_m_s), last.speed_m_s
        for number in range(steps):
            middle_s = (number + 0.5) * seconds / steps
            speed = max(0.0, individual.speed.after(last.speed_m_s, middle_s))
            heading += individual.turn_rate.after(individual.turn_rate.latest, middle_s) * seconds / steps
            x_m += speed * cos(heading) * seconds / steps
            y_m += speed * sin(heading) * seconds / steps
        vx_m_s, vy_m_s = speed * cos(heading), speed * sin(heading)
        return certain(general.likely._replace(x_m=x_m, y_m=y_m, vx_m_s=vx_m_s, vy_m_s=vy_m_s))
