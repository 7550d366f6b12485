"""The results of linking percepts, as JSON lines or as text."""

from typing import TYPE_CHECKING, Any

from dyknow.console.command import Call
from dyknow.console.output.shown import Shown, line, styled
from dyknow.kpl.introspection.link_reasons import because
from dyknow.model.instants import US_PER_MS, US_PER_S

if TYPE_CHECKING:
    from dyknow.anchoring.links.objects import LinkEvent
    from dyknow.anchoring.links.states import ObjectState
    from dyknow.anchoring.links.structures import LinkOutcome, ObjectLinkage, StateRecord
    from dyknow.navigation import LocalFrame

_STYLES = {
    "established": "green",
    "reestablished": "green",
    "unlinked": "yellow",
    "reclassified": "cyan",
    "find": "green",
    "track": "green",
    "reacquire": "green",
    "lost": "yellow",
}


class LinkOutput:
    """States and events of objects; as text events, and at the end a table of all objects."""

    def __init__(self, call: Call) -> None:
        self._out = call.out
        self._objects: dict[tuple[str, str], _Seen] = {}
        self._frame: LocalFrame | None = None

    def on_frame(self, frame: "LocalFrame | None") -> None:
        """Where x and y are 0 on earth, once that is known."""
        if frame is not None and self._frame is None and self._out.json_lines:
            place = f"latitude {frame.latitude_deg:.7f}, longitude {frame.longitude_deg:.7f}"
            self._out.note(f"x_m and y_m are metres east and north of {place}", style="dim")
        self._frame = frame

    def on_outcome(self, outcome: "LinkOutcome") -> None:
        """All of some ticks, in the order of time; of one time the events first."""
        if not self._out.json_lines:
            for event in outcome.events:
                self._show(event)
            for state in outcome.states:
                self._objects.setdefault((state.type, state.symbol), _Seen(state.valid_us)).on_state(state)
            return
        records: list[tuple[int, int, dict[str, Any]]] = [
            *((each.valid_us, 0, self._event(each)) for each in outcome.events),
            *((each.valid_us, 1, self._state(each)) for each in outcome.states),
        ]
        for _, _, record in sorted(records, key=lambda each: each[:2]):
            self._out.line(record)

    def end(self, linkage: "ObjectLinkage") -> None:
        """The table of objects."""
        if self._out.json_lines:
            return
        if not self._objects:
            self._out.show("no objects: no condition to establish one became true")
            return
        rows: list[tuple[Shown, ...]] = []
        for (type_, symbol), seen in self._objects.items():
            now = "linked" if linkage.anchored(symbol) else "predicted" if linkage.find(symbol) else "forgotten"
            span = f"{seen.first_us / US_PER_S:.1f} .. {seen.last_us / US_PER_S:.1f}"
            rows.append((symbol, type_, span, " ".join(seen.sources), now))
        columns = ("symbol", "type", "seconds", "from", "in the end")
        self._out.table("", columns, rows, wraps=("from",))

    def _show(self, event: "LinkEvent") -> None:
        when = styled(f"{event.valid_us / US_PER_S:10.3f} s", "dim")
        between = f"{event.source} -> {event.target}" if event.source else event.target
        kind = styled(event.kind, _STYLES.get(event.kind, "dim"))
        self._out.show(line(when, "  ", styled(between, "bold"), "  ", kind, f": {because(event.reason)}"), whole=True)

    def _event(self, event: "LinkEvent") -> dict[str, Any]:
        return {
            "t_ms": _ms(event.valid_us),
            "event": event.kind,
            "from": event.source or None,
            "to": event.target,
            "because": because(event.reason),
        }

    def _state(self, record: "StateRecord") -> dict[str, Any]:
        place = self._place(record.state)
        branches = () if record.prediction is None else record.prediction.hypotheses
        hypotheses = [{**self._place(state), "weight": round(weight, 4)} for state, weight in branches]
        return {
            "t_ms": _ms(record.valid_us),
            "symbol": record.symbol,
            "type": record.type,
            **place,
            "linked_to": list(record.linked_to),
            "hypotheses": hypotheses or [{**place, "weight": 1.0}],
            **({"certainty": round(record.weight, 4)} if record.weight < 1.0 else {}),
            **({"late_ms": _ms(record.late_us)} if record.late_us else {}),
        }

    def _place(self, state: "ObjectState") -> dict[str, float]:
        place = {"x_m": round(state.x_m, 3), "y_m": round(state.y_m, 3)}
        if self._frame is not None:
            latitude_deg, longitude_deg = self._frame.level(state.y_m, state.x_m, 0.0)
            place |= {"latitude_deg": round(latitude_deg, 7), "longitude_deg": round(longitude_deg, 7)}
        return place


class _Seen:
    """One object over all its states."""

    def __init__(self, first_us: int) -> None:
        self.first_us = self.last_us = first_us
        self.sources: dict[str, None] = {}

    def on_state(self, state: "StateRecord") -> None:
        self.last_us = state.valid_us
        self.sources.update(dict.fromkeys(state.linked_to))


def _ms(valid_us: int) -> float:
    return valid_us // US_PER_MS if valid_us % US_PER_MS == 0 else valid_us / US_PER_MS
