"""What commands have in common that pass on what the federation knows: how far it may go, and for how long."""

import ipaddress
from collections.abc import Iterable
from contextlib import suppress
from typing import Annotated, Final, TypeAlias

import typer

from console.command import Call
from dyknow.model.errors import WrongCall
from runtime.client import Client
from runtime.recorder.recorder import Recorder, Sink

THERE: Final = "127.0.0.1"
Beyond: TypeAlias = Annotated[
    bool, typer.Option("--beyond-this-machine", help="Other machines may be reached; nothing there is encrypted.")
]
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
