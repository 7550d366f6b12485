"""`dyknow remote-id`: platforms as Remote ID messages, as MAVLink carries them."""

from typing import Annotated

import typer

from console.arguments import Duration
from console.centre.client import connected
from console.command import Call, command
from console.commands.outward.passing import (
    SHORTEST_PERIOD_US,
    Beyond,
    Every,
    To,
    Undulation,
    pass_on,
    say_begun,
    say_ended,
)
from console.errors import DONE, INTERRUPTED
from console.processes.supervision import interruptible
from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.model.errors import WrongCall
from proxies.outward.outlets import Outlet, parse_destination
from proxies.outward.remote_id import RemoteIdMessages, RemoteIdState, check_serial
from runtime.recorder.things import PLATFORM_LABELS, ThingState, ThingStates


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
    with connected(call) as client:
        outlet = Outlet(destination)

        def on_track(track: ThingState) -> None:
            for message in messages.encode(state_of(track, serials.get(track.unit, ""))):
                outlet.send(message, client.now_us())

        tracks = ThingStates(period_us, client.federation_us, on_track)
        try:
            with interruptible():
                say_begun(call, str(destination))
                recorder = pass_on(call, client, tracks, PLATFORM_LABELS, lasts_us)
        except KeyboardInterrupt:
            return INTERRUPTED
        finally:
            outlet.close()
    say_ended(call, outlet, recorder, tracks.refused)
    return DONE


def _serial(text: str) -> tuple[str, str]:
    unit, _, number = text.partition("=")
    if not unit:
        raise WrongCall(f"--serial: {text!r} names no platform; write U=SERIAL.")
    return unit, check_serial(number)


def state_of(track: ThingState, serial: str = "") -> RemoteIdState:
    """The state of a platform as Remote ID has it."""
    altitude, altitude_sd, height = (track.part(name) for name in ("heli-altitude", "altitude sd", "heli-height"))
    velocity, home = track.part("heli-velocity"), track.part("heli-home")
    return RemoteIdState(
        track.unit,
        track.latitude_deg,
        track.longitude_deg,
        track.valid_us,
        altitude_m=altitude[0] if altitude else None,
        height_m=height[0] if height else None,
        velocity_m_s=(velocity[0], velocity[1], velocity[2]) if velocity and len(velocity) == 3 else None,
        horizontal_sd_m=track.horizontal_sd_m,
        vertical_sd_m=altitude_sd[0] if altitude_sd else None,
        home=(home[0], home[1]) if home and len(home) > 1 else None,
        serial=serial,
    )
