"""`dyknow remote-id`: platforms as Remote ID messages, as MAVLink carries them."""

from math import cos, radians, sin
from typing import Annotated

import typer

from dyknow.console.arguments import Duration
from dyknow.console.command import Call, command
from dyknow.console.commands.outward.passing import (
    SHORTEST_PERIOD_US,
    Beyond,
    Every,
    To,
    Undulation,
    send,
)
from dyknow.console.picture.things import PLATFORM_LABELS, ThingState, ThingStates
from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.model.errors import WrongCall
from dyknow.proxies.outward.outlets import Outlet, parse_destination
from dyknow.proxies.outward.remote_id import RemoteIdMessages, RemoteIdState, check_serial
from dyknow.runtime.client import Client


@command(example="dyknow remote-id --to udp://127.0.0.1:14560 --serial 7=1A2B5X7Y9Z")
def remote_id(
    call: Call,
    *,
    to: To,
    every: Every = "1s",
    serial: Annotated[
        list[str] | None,
        typer.Option(metavar="U=SERIAL", help="The serial number of a platform's aircraft (repeatable)."),
    ] = None,
    undulation: Undulation = None,
    beyond: Beyond = False,
    duration: Duration = None,
) -> int:
    """Send Remote ID messages about platforms until Ctrl-C: each alone and in a pack, a datagram a message."""
    destination = parse_destination(to, beyond=beyond, kinds=("udp",))
    period_us = duration_us(every, option="--every", least_us=SHORTEST_PERIOD_US)
    lasts_us = duration_us(duration, option="--duration", least_us=SHORTEST_US) if duration else None
    serials = dict(_serial(each) for each in serial or ())
    messages = RemoteIdMessages(undulation)

    def things_of(client: Client, outlet: Outlet) -> ThingStates:
        def on_track(track: ThingState) -> None:
            for message in messages.encode(state_of(track, serials.get(track.unit, ""))):
                outlet.send(message, client.now_us())

        return ThingStates(period_us, client.federation_us, on_track)

    return send(call, destination, lasts_us, PLATFORM_LABELS, things_of)


def _serial(text: str) -> tuple[str, str]:
    unit, _, number = text.partition("=")
    if not unit:
        raise WrongCall(f"--serial: {text!r} names no platform; write U=SERIAL.")
    return unit, check_serial(number)


def state_of(track: ThingState, serial: str = "") -> RemoteIdState:
    """The state of a platform as Remote ID has it."""
    velocity_m_s = None
    if track.speed_m_s is not None:
        course, speed_m_s = radians(track.course_deg), track.speed_m_s
        velocity_m_s = speed_m_s * cos(course), speed_m_s * sin(course), -track.climb_m_s
    return RemoteIdState(
        track.unit,
        track.latitude_deg,
        track.longitude_deg,
        track.valid_us,
        altitude_m=track.altitude_m,
        height_m=track.height_m,
        velocity_m_s=velocity_m_s,
        horizontal_sd_m=track.horizontal_sd_m,
        vertical_sd_m=track.altitude_sd_m,
        home=track.home,
        serial=serial,
    )
