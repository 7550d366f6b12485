"""The common part of commands that pass the federation's data on: how far it may go, and for how long."""

import ipaddress
import math
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Annotated, Final, TypeAlias

import typer

from dyknow.console.centre.client import connected
from dyknow.console.command import Call
from dyknow.console.errors import DONE, INTERRUPTED
from dyknow.console.output.output import counted
from dyknow.console.output.shown import line, styled
from dyknow.console.picture.things import ThingStates
from dyknow.console.processes.supervision import interruptible
from dyknow.model.errors import WrongCall
from dyknow.proxies.outward.outlets import Destination, Outlet
from dyknow.runtime.client import Client
from dyknow.runtime.recorder.recorder import Recorder, Sink

THERE: Final = "127.0.0.1"
Beyond: TypeAlias = Annotated[
    bool, typer.Option("--beyond-this-machine", help="Other machines may be reached; nothing there is encrypted.")
]
To: TypeAlias = Annotated[
    str, typer.Option("--to", metavar="DESTINATION", help="An address and port, udp://127.0.0.1:6969.")
]
Every: TypeAlias = Annotated[str, typer.Option(metavar="TIME", help="How often each platform is sent.")]
Undulation: TypeAlias = Annotated[
    float | None,
    typer.Option(
        metavar="METRES", min=-107, max=107, help="How far mean sea level lies above the ellipsoid there (geoid)."
    ),
]
SHORTEST_PERIOD_US: Final = 100_000
_STEP_S = 0.1


def check_reach(host: str, *, beyond: bool, option: str) -> None:
    """Refuse an address beyond this machine, unless that was asked for; names are none, since they may change.

    Raises:
        WrongCall: it is no address, or one beyond this machine.
    """
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        raise WrongCall(f"{option}: {host!r} is no IP address; write {THERE}, or ::1.") from None
    if not address.is_loopback and not beyond:
        raise WrongCall(
            f"{option}: {host} is beyond this machine, where nothing is encrypted; add --beyond-this-machine if that is meant."
        )


def pass_on(call: Call, client: Client, sink: Sink, labels: Iterable[str], lasts_us: int | None) -> Recorder:
    """Have the sink take what a recording would, from when a platform is there until the time is over or Ctrl-C."""
    begun_us = client.now_us()

    def is_over() -> bool:
        return lasts_us is not None and client.now_us() - begun_us >= lasts_us

    if not client.settle():
        call.out.note("no platform is there yet; it begins with the first.")
    while not client.centre.platforms() and not is_over():
        client.step(_STEP_S)
    recorder = Recorder(client, sink, labels, note=lambda text: call.out.note(text, style="yellow"))
    with suppress(KeyboardInterrupt):
        while not is_over():
            recorder.step()
    recorder.close()
    return recorder


def send(
    call: Call,
    to: Destination,
    lasts_us: int | None,
    labels: Iterable[str],
    things_of: Callable[[Client, Outlet], ThingStates],
) -> int:
    """Send platforms and objects, in messages made by `things_of`, and report those sent and lost, by reason."""
    with connected(call) as client:
        outlet = Outlet(to)
        things = things_of(client, outlet)
        try:
            with interruptible():
                call.out.say(line(styled("sending", "green"), f" to {to}; Ctrl-C ends it"), event="sending", to=str(to))
                recorder = pass_on(call, client, things, labels, lasts_us)
        except KeyboardInterrupt:
            return INTERRUPTED
        finally:
            outlet.close()
    sent, refused = outlet.counts["sent"], things.refused
    lost = {reason: count for reason, count in sorted(outlet.counts.items()) if reason != "sent"}
    if outlet.lost or refused:
        why = ", ".join(f"{reason}: {count}" for reason, count in lost.items())
        call.out.note(
            f"{counted(outlet.lost, 'message')} lost{f' ({why})' if why else ''}, "
            f"{counted(refused, 'value')} of other members not usable.",
            style="yellow",
        )
    shown = f": {counted(sent, 'message')} of {counted(len(recorder.units), 'platform')}"
    call.out.say(
        line(styled("sent", "green"), shown), event="sent", to=str(to), units=recorder.units, sent=sent, lost=lost,
        refused=refused,
    )  # fmt: skip
    return DONE


def place(text: str, *, option: str) -> tuple[float, float]:
    """Latitude and longitude of `58.4,15.6`; raises WrongCall."""
    try:
        latitude_deg, longitude_deg = map(float, text.split(","))
    except ValueError:
        latitude_deg = longitude_deg = math.nan
    if not (abs(latitude_deg) <= 90 and abs(longitude_deg) <= 180):
        raise WrongCall(f"{option}: {text!r} is no place; write latitude and longitude, as in 58.4,15.6.")
    return latitude_deg, longitude_deg
