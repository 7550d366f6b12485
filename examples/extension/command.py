"""`dyknow ring`: ring the beacon of a platform."""

from typing import Annotated

import typer

from dyknow.console.centre.client import connected
from dyknow.console.command import Call, command
from dyknow.console.output.output import unit_json
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import Done
from dyknow.runtime.library.jobs import failure_of
from examples.extension.beacon import RingBeacon


@command(example="dyknow ring 0 --times 3 --extension examples.extension")
def ring(
    call: Call, unit: Annotated[str, typer.Argument(help="A platform that has a beacon.")], *, times: int = 1
) -> int:
    """Ring the beacon of a platform; exit 2 if it has none."""
    with connected(call) as client:
        [dialogue] = client.ask(client.chosen(unit), RingBeacon(times=times), Performative.REQUEST, 3.0)
    done = next((content for content in dialogue.results if isinstance(content, Done)), None)
    if done is None:
        raise failure_of(dialogue, "no answer in time")
    call.out.say(f"platform {unit}: {done.text}", unit=unit_json(unit), answer=done.text)
    return 0
