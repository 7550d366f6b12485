"""The parameter protocol: an operator's names for what `Settings` holds."""

from math import isfinite

from pymavlink.dialects.v20 import all as mavlink

from dyknow.sim_uavs.autopilot.link import Message
from dyknow.sim_uavs.autopilot.personas import ParameterKind, Persona
from dyknow.sim_uavs.dynamics.settings import VehicleSettings


class Parameters:
    """Reads and writes `settings` under the names and units of the persona; every write is answered by its outcome."""

    def __init__(self, persona: Persona, settings: VehicleSettings, system_id: int) -> None:
        self._persona, self._settings, self._system_id = persona, settings, system_id
        self._kinds = persona.parameters

    def all(self) -> list[Message]:
        return [self._told(index) for index in range(len(self._kinds))]

    def read(self, name: str, index: int) -> list[Message]:
        """The parameter by name, or by index when that is not negative; an unknown one is not answered."""
        found = index if index >= 0 else self._index(name)
        return [self._told(found)] if found is not None and found < len(self._kinds) else []

    def write(self, name: str, sent: float) -> list[Message]:
        """Set a parameter and tell its value: the old one when the new one is refused."""
        index = self._index(name)
        if index is None:
            return []
        kind = self._kinds[index]
        value = self._persona.off_wire(kind, sent)
        if kind.field and isfinite(value) and kind.least <= value <= kind.most:
            setattr(self._settings, kind.field, value / kind.scale)
        return [self._told(index)]

    def _index(self, name: str) -> int | None:
        return next((i for i, kind in enumerate(self._kinds) if kind.name == name), None)

    def _value(self, kind: ParameterKind) -> float:
        if not kind.field:
            return float(self._system_id)
        value: float = getattr(self._settings, kind.field)
        return value * kind.scale

    def _told(self, index: int) -> Message:
        kind = self._kinds[index]
        value = self._persona.on_wire(kind, self._value(kind))
        return mavlink.MAVLink_param_value_message(kind.name.encode(), value, kind.kind, len(self._kinds), index)
