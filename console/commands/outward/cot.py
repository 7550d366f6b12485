"""`dyknow cot`: platforms, and by option objects and alarms, as Cursor on Target events."""

from dataclasses import dataclass
from typing import Annotated, Literal

import typer

from dyknow.console.arguments import Duration
from dyknow.console.command import Call, command
from dyknow.console.commands.outward.passing import (
    SHORTEST_PERIOD_US,
    Beyond,
    Every,
    To,
    Undulation,
    place,
    send,
)
from dyknow.console.picture.differences import Row
from dyknow.console.picture.things import AIRCRAFT, PLATFORM_LABELS, ThingState, ThingStates
from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.model.errors import WrongCall
from dyknow.proxies.outward.cot import ALARM, UAV, UNKNOWN_AIR, UNKNOWN_GROUND, CotMotion, CotPoint, cot_event
from dyknow.proxies.outward.outlets import Outlet, parse_destination
from dyknow.runtime.client import Client


@command(example="dyknow cot --to udp://127.0.0.1:6969 --alarms")
def cot(
    call: Call,
    *,
    to: To,
    every: Every = "1s",
    objects: Annotated[
        Literal["global-objects", "object-tracks", "believed-objects", "traffic"] | None,
        typer.Option(help="Objects of this label as well; all but traffic need --origin."),
    ] = None,
    origin: Annotated[
        str | None, typer.Option(metavar="LAT,LON", help="The federation's origin, which places of objects refer to.")
    ] = None,
    alarms: Annotated[bool, typer.Option("--alarms", help="Alarms as well.")] = False,
    undulation: Undulation = None,
    beyond: Beyond = False,
    duration: Duration = None,
) -> int:
    """Send Cursor on Target events about platforms until Ctrl-C, over UDP (an event a datagram) or TCP."""
    destination = parse_destination(to, beyond=beyond)
    period_us = duration_us(every, option="--every", least_us=SHORTEST_PERIOD_US)
    lasts_us = duration_us(duration, option="--duration", least_us=SHORTEST_US) if duration else None
    if objects not in {None, AIRCRAFT} and not origin:
        raise WrongCall(
            "--objects: their places are metres from the federation's origin; say where it is: --origin LAT,LON."
        )
    at = place(origin, option="--origin") if origin else None

    def things_of(client: Client, outlet: Outlet) -> ThingStates:
        sender = CotSender(client, outlet, call.settings.federation, period_us, undulation)
        on_alarm = sender.on_alarm if alarms else None
        return ThingStates(period_us, client.federation_us, sender.on_track, on_alarm, at)

    return send(call, destination, lasts_us, (*PLATFORM_LABELS, *filter(None, [objects])), things_of)


@dataclass(frozen=True)
class CotSender:
    """Events of tracks and alarms, each valid for five periods."""

    client: Client
    outlet: Outlet
    federation: str
    period_us: int
    undulation_m: float | None = None

    def on_track(self, track: ThingState) -> None:
        """A platform as a friendly drone, an object as an unknown thing on the ground, or in the air."""
        name = ".".join(filter(None, (track.label, track.unit, track.symbol)))
        motion = None if track.speed_m_s is None else CotMotion(track.course_deg, track.speed_m_s)
        kind = UAV if not track.label else UNKNOWN_AIR if track.label == AIRCRAFT else UNKNOWN_GROUND
        self._send(name, kind, track.symbol or track.unit, _point_of(track), track.valid_us, motion)

    def on_alarm(self, name: str, alarm: Row, tracks: list[ThingState]) -> None:
        """In the middle of those that it is about; when it closes the event ends."""
        if not tracks:
            return
        middle = CotPoint(
            sum(track.latitude_deg for track in tracks) / len(tracks),
            sum(track.longitude_deg for track in tracks) / len(tracks),
        )
        words = f"{alarm['monitor']} of {', '.join(alarm['units'])} by {alarm['by']} {alarm['event']}"
        at_us, is_over = max(track.valid_us for track in tracks), alarm["event"] != "opened"
        self._send(f"alarm.{alarm['by']}.{name}", ALARM, alarm["monitor"], middle, at_us, text=words, is_over=is_over)

    def _send(
        self, name: str, kind: str, callsign: str, point: CotPoint, at_us: int, motion: CotMotion | None = None, *,
        text: str = "", is_over: bool = False,
    ) -> None:  # fmt: skip
        now_us = self.client.federation_us()
        lasts_us = _ALARM_LASTS_US if kind == ALARM else 5 * self.period_us
        event = cot_event(
            f"dyknow.{self.federation}.{name}",
            kind,
            callsign,
            point,
            time_us=min(at_us, now_us),
            now_us=now_us,
            stale_us=now_us if is_over else now_us + lasts_us,
            motion=motion,
            text=text,
            undulation_m=self.undulation_m,
        )
        self.outlet.send(event, self.client.now_us())


_ALARM_LASTS_US = 60_000_000


def _point_of(track: ThingState) -> CotPoint:
    return CotPoint(
        track.latitude_deg, track.longitude_deg, track.altitude_m, track.horizontal_sd_m, track.altitude_sd_m
    )
