"""Beliefs and their events, as JSON lines or as text."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from math import isinf
from typing import TYPE_CHECKING, Any

from dyknow.anchoring.belief.description import ALTITUDE, POSITION
from dyknow.console.command import Call
from dyknow.console.output.shown import Shown, line, styled
from dyknow.model.instants import US_PER_MS, US_PER_S

if TYPE_CHECKING:
    from dyknow.anchoring.belief.knowledge.informed import InformationRequest, InformedModel
    from dyknow.anchoring.belief.reports import BelievedInstance, LifeEvent, UpdateReport
    from dyknow.navigation import LocalFrame

MOST_SHOWN = 100
"""Instances in one line; the most certain ones."""
_STYLES = {"created": "cyan", "confirmed": "green", "deleted": "yellow"}


class WorldOutput:
    """A line for each update, or a line for each event and a table in the end."""

    def __init__(self, call: Call, informed: "InformedModel") -> None:
        self._out, self._informed, self._environment = call.out, informed, informed.environment
        self._has_knowledge = False

    def on_selected(self, events: "Sequence[LifeEvent]", *, given: bool) -> None:
        """Which knowledge was loaded."""
        self._has_knowledge = given
        if given and not events:
            self._out.note("no knowledge is needed for that task: nothing is loaded", style="yellow")
        for event in events:
            self._out.note(f"{event.kind} {event.what}")

    def on_report(self, report: "UpdateReport") -> None:
        if not self._out.json_lines:
            for event in report.events:
                self._show(event)
            return
        associations = [_shares(each) for each in report.associations]
        shown, more = self._instances()
        record: dict[str, Any] = {"t_ms": _ms(report.valid_us)}
        if associations or report.is_scan:
            record["association"] = _together(report.associations)
        if report.is_scan:
            record |= {"associations": associations, "exact": report.is_exact}
        record |= {
            "instances": [_instance(each, self._environment.model.frame) for each in shown],
            "events": [_event(each) for each in report.events],
        }
        if self._has_knowledge:
            record["requests"] = [_request(each) for each in self._informed.requests()[:MOST_SHOWN]]
        if more:
            record["more_instances"] = more
        self._out.line(record)

    def end(self) -> None:
        """Print the table of the final beliefs, and the counts of observations that were left out."""
        counts = self._environment.counts
        if counts:
            listed = ", ".join(f"{number} {what}" for what, number in sorted(counts.items()))
            self._out.note(f"not taken as it came: {listed}", style="yellow")
        if self._out.json_lines:
            return
        instances, more = self._instances()
        if not instances:
            self._out.show("nothing is believed to exist")
            return
        rows = [
            (each.name, f"{each.existence:.3f}", each.status, _likeliest(each.type), ", ".join(_attributes(each)))
            for each in instances
        ]
        self._out.table("", ("instance", "existence", "status", "type", "attributes"), rows, wraps=("attributes",))
        if more:
            self._out.show(f"and {more} less certain ones")
        for each in self._informed.requests()[:MOST_SHOWN] if self._has_knowledge else ():
            by = f"by {each.sensor}" if each.sensor else "which no sensor observes"
            self._out.show(
                line("wanted: ", styled(f"{each.what} of {each.instance}", "bold"), f", {by}: {each.because}")
            )

    def _instances(self) -> "tuple[list[BelievedInstance], int]":
        rows = self._environment.most_certain(MOST_SHOWN)
        shown = [self._environment.instance(row) for row in rows]
        matched = self._informed.matched
        return [each._replace(known=matched.get(each.name, "")) for each in shown], len(self._environment.table) - len(
            rows
        )

    def _show(self, event: "LifeEvent") -> None:
        when = styled(f"{event.valid_us / US_PER_S:10.3f} s", "dim")
        parts: list[Shown] = [when, "  "]
        if event.instance:
            parts += [styled(event.instance, "bold"), "  "]
        parts += [styled(event.kind, _STYLES.get(event.kind, "dim"))]
        if event.what:
            parts.append(f" {event.what}")
        if event.instance:
            parts.append(f", existence {event.existence:.3f}")
        if event.because:
            parts.append(f": {event.because}")
        self._out.show(line(*parts), whole=True)


def _instance(each: "BelievedInstance", frame: "LocalFrame | None") -> dict[str, Any]:
    attributes: dict[str, Any] = {
        name: {"mean": _numbers(belief.mean), "covariance": [_numbers(row) for row in belief.covariance]}
        for name, belief in each.gaussian.items()
    }
    if frame is not None and POSITION in attributes:
        attributes[POSITION] |= _on_earth(frame, each)
    attributes |= {name: _shares(shares) for name, shares in each.categorical.items()}
    record: dict[str, Any] = {
        "id": each.name,
        "existence": _rounded(each.existence),
        "status": each.status,
        "type": _shares(each.type),
        "attributes": attributes,
    }
    if each.known:
        record["known"] = each.known
    if each.relations:
        record["relations"] = [
            {"name": name, "to": other, "probability": _rounded(value)}
            for (name, other), value in each.relations.items()
        ]
    return record


def _on_earth(frame: "LocalFrame", each: "BelievedInstance") -> dict[str, float]:
    """Latitude and longitude of a position, at its altitude if that is believed in."""
    east_m, north_m = each.gaussian[POSITION].mean[:2].tolist()
    height = each.gaussian.get(ALTITUDE)
    altitude_m = frame.altitude_m if height is None else float(height.mean[0])
    latitude_deg, longitude_deg = frame.level(north_m, east_m, altitude_m)
    return {"latitude_deg": round(latitude_deg, 7), "longitude_deg": round(longitude_deg, 7)}


def _event(event: "LifeEvent") -> dict[str, Any]:
    record: dict[str, Any] = {"t_ms": _ms(event.valid_us), "event": event.kind}
    if event.instance:
        record |= {"id": event.instance, "existence": _rounded(event.existence)}
    return record | {key: value for key, value in (("what", event.what), ("because", event.because)) if value}


def _request(request: "InformationRequest") -> dict[str, Any]:
    until = {} if isinf(request.until_us) else {"until_ms": _ms(int(request.until_us))}
    return {
        "id": request.instance,
        "what": request.what,
        "sensor": request.sensor or None,
        "because": request.because,
        "place_m": None if request.place_m is None else _numbers(request.place_m),
        **until,
    }


def _together(associations: Iterable[Mapping[str, float]]) -> dict[str, float]:
    """Of all observations of a look: the probability that an instance was observed, and the expected numbers of the rest."""
    found = Counter[str]()
    for each in associations:
        found.update(each)
    return _shares(found)


def _likeliest(shares: Mapping[str, float]) -> str:
    name = max(shares, key=shares.__getitem__)
    return f"{name} {shares[name]:.2f}"


def _attributes(each: "BelievedInstance") -> Iterable[str]:
    for name, belief in each.gaussian.items():
        size = len(belief.mean)
        yield f"{name} ({', '.join(f'{value:.1f}' for value in belief.mean[: min(size, 2)])})"
    for name, shares in each.categorical.items():
        yield f"{name} {_likeliest(shares)}"
    for (name, other), value in each.relations.items():
        yield f"{name} {other} {value:.2f}"


def _shares(shares: Mapping[str, float]) -> dict[str, float]:
    return {name: _rounded(value) for name, value in shares.items()}


def _numbers(values: Iterable[float]) -> list[float]:
    return [_rounded(float(value)) for value in values]


def _rounded(value: float) -> float:
    """To twelve significant digits: sums over all associations agree to nine."""
    return float(f"{value:.12g}")


def _ms(valid_us: int) -> float:
    return valid_us // US_PER_MS if valid_us % US_PER_MS == 0 else valid_us / US_PER_MS
