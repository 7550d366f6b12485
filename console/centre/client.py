"""A command's connection to its federation, and what its conversations mean for the command's exit."""

import os
from collections.abc import Iterator
from contextlib import contextmanager

from console.command import Call
from dyknow.model.errors import DyknowError, FederationFailed, NothingFound, WrongCall
from federation.messages.acts import Performative
from federation.messages.dialogue import Dialogue
from runtime.client import Client, Surroundings, command_centre, surroundings
from runtime.configuration.reach import COMMAND_CENTRE, client_wire

P = Performative


@contextmanager
def connected(call: Call) -> Iterator[Client]:
    """The command centre of this call in its federation.

    Raises:
        SessionFailed: an endpoint cannot be listened on, or the configuration is refused.
        RosterError: the roster or the key does not load.
    """
    settings = call.settings
    centre = command_centre(settings, f"{COMMAND_CENTRE}-{os.getpid()}")
    with call.out.waiting("looking for platforms"):
        client = Client(_surroundings(call), centre, settings.federation, settings.extensions)
    with client:
        yield client


def _surroundings(call: Call) -> Surroundings:
    return surroundings(client_wire(call.settings))


def failure_of(dialogue: Dialogue, otherwise: str) -> DyknowError:
    """The error for a conversation without the expected result; `otherwise` where no reason was given."""
    text = f"platform {dialogue.unit}: {dialogue.trouble or otherwise}"
    performative = dialogue.refusal[0] if dialogue.refusal is not None else None
    if performative is P.NOT_UNDERSTOOD:
        return WrongCall(text)
    return NothingFound(text) if performative is P.REFUSE else FederationFailed(text)
