"""The context of a condition: other objects of the linkage, and streams."""

from collections.abc import Mapping
from typing import Final, Protocol

from dyknow import NO_VALUE, Label, Value
from dyknow.anchoring.links.assignment import natural
from dyknow.anchoring.links.objects import LinkObject
from dyknow.anchoring.links.specification import DISTANCES, StateFeature
from dyknow.anchoring.links.states import ObjectState

DOMAIN: Final = ".objects"
STATE_FEATURES: Final[Mapping[str, StateFeature]] = {
    "speed": lambda state: state.speed_m_s,
    "deviation": lambda state: state.deviation_m,
    "x": lambda state: state.x_m,
    "y": lambda state: state.y_m,
    "x_m": lambda state: state.x_m,
    "y_m": lambda state: state.y_m,
    "vx_m_s": lambda state: state.vx_m_s,
    "vy_m_s": lambda state: state.vy_m_s,
    "sd_m": lambda state: state.deviation_m / 2**0.5,
}
"""The attributes of every state, by their names in conditions and streams."""


def read_state(name: str, state: ObjectState) -> Value:
    """A feature that every state has, or an attribute."""
    feature = STATE_FEATURES.get(name)
    return state.attributes.get(name, NO_VALUE) if feature is None else feature(state)


class ConditionStreams(Protocol):
    """Streams of the network that a linkage belongs to."""

    def value(self, label: Label, valid_us: int) -> Value:
        """The value of a stream in the state of a time."""

    def members(self, domain: str) -> tuple[str, ...]:
        """The objects that a stream names."""

    def has_occurred(self, label: Label, after_us: int | None, valid_us: int) -> bool:
        """Whether an event belongs to the state of a time; the state before it was at `after_us`, None: there was none."""


class ConditionContext:
    """The objects of a linkage by type and symbol, and the streams around it; None: there are none."""

    def __init__(self, objects: Mapping[str, Mapping[str, LinkObject]], streams: ConditionStreams | None) -> None:
        self._objects, self._streams = objects, streams

    def members(self, domain: str) -> tuple[str, ...]:
        """The objects of a type of the linkage, or those that a stream names."""
        own = self._objects.get(domain.removesuffix(DOMAIN))
        if own is not None:
            return tuple(sorted(own, key=natural))
        return () if self._streams is None else self._streams.members(domain)

    def value(self, label: Label, valid_us: int) -> Value:
        """Of objects of the linkage by their states, else of a stream; distances are those on the plane."""
        if label.objects:
            states = [state for state in map(self._state, label.objects) if state is not None]
            if label.feature in DISTANCES and len(states) == len(label.objects) == 2:
                return states[0].distance_m(states[1])
            if len(label.objects) == len(states) == 1:
                value = read_state(label.feature.rpartition(".")[2], states[0])
                if value is not NO_VALUE:
                    return value
        return NO_VALUE if self._streams is None else self._streams.value(label, valid_us)

    def has_occurred(self, label: Label, after_us: int | None, valid_us: int) -> bool:
        """Whether an event belongs to the state of a time."""
        return self._streams is not None and self._streams.has_occurred(label, after_us, valid_us)

    def _state(self, symbol: str) -> ObjectState | None:
        found = (objects[symbol].state for objects in self._objects.values() if symbol in objects)
        return next(found, None)


ALONE: Final = ConditionContext({}, None)
"""Of a condition that reads the states of its objects only."""
