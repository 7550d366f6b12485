"""A command's connection to its federation."""

import os
from collections.abc import Iterator
from contextlib import contextmanager

from dyknow.console.command import Call
from dyknow.runtime.client import Client, ClientPorts, client_ports, command_centre
from dyknow.runtime.configuration.reach import client_wire, speaks_as


@contextmanager
def connected(call: Call) -> Iterator[Client]:
    """The command centre of this call in its federation.

    Raises:
        SessionFailed: an endpoint cannot be listened on, or the configuration is refused.
        RosterError: the roster or the key does not load.
    """
    with call.out.waiting("looking for platforms"):
        client = client_of(call)
    client.on_trouble = lambda unit, why: call.out.note(f"platform {unit}: {why}", style="red")
    with client:
        yield client


def client_of(call: Call) -> Client:
    """The same, which says nothing on its own; raises what `connected` does."""
    settings = call.settings
    centre = command_centre(settings, speaks_as(settings).named(os.getpid()))
    return Client(_client_ports(call), centre, settings.federation, settings.extensions, settings.ontology)


def _client_ports(call: Call) -> ClientPorts:
    return client_ports(client_wire(call.settings, speaks_as(call.settings).unit))


def note_unreached(call: Call, client: Client) -> None:
    """Name platforms that only others hear: where endpoints are named and nothing is found by itself, all are needed."""
    if not call.settings.connect:
        return
    unreached = [seen.unit for seen in client.centre.platforms() if seen.state == "suspect" and not seen.services]
    if unreached:
        call.out.note(
            f"platform {', '.join(unreached)} is heard by others, not from here: name its endpoint as well (--connect)."
        )
