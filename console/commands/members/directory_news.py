"""Changes of the directory, as one platform reports them: `dyknow ls --follow` (thesis 9.3.4)."""

from functools import partial
from typing import NoReturn

from dyknow.console.command import Call
from dyknow.console.output.output import unit_json
from dyknow.console.output.shown import line, styled
from dyknow.federation.members.liveness import PeerState
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import Directory, DirectoryEvent
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.runtime.client import Client
from dyknow.runtime.configuration.instants import clock_time

_STEP_S = 0.2
_COLOURS = {"appeared": "green", "returned": "green", "gone": "red", "suspected": "yellow"}


def follow_directory(call: Call, client: Client) -> NoReturn:
    """Subscribe to the directory of one platform, or of the next when that is gone, until Ctrl-C."""
    dialogue: Dialogue | None = None
    while True:
        alive = [seen.unit for seen in client.centre.platforms() if seen.state == PeerState.ALIVE.value]
        if dialogue is not None and (dialogue.over or dialogue.unit not in alive):
            _show(call, DirectoryEvent(event="platform-gone", unit=dialogue.unit, at_us=client.now_us()), None)
            alive, dialogue = [unit for unit in alive if unit != dialogue.unit], None
        if dialogue is None and alive:
            dialogue = client.say(alive[0], Performative.SUBSCRIBE, Directory(), standing=True)
        client.wait_for(partial(_has_news, dialogue), _STEP_S)
        if dialogue is not None:
            for said in dialogue.results:
                if isinstance(said, DirectoryEvent):
                    _show(call, said, dialogue.unit)
            dialogue.said.clear()


def _has_news(dialogue: Dialogue | None) -> bool:
    return dialogue is not None and bool(dialogue.said or dialogue.over)


def _show(call: Call, said: DirectoryEvent, by: str | None) -> None:
    """One change; `by` reported it, None: this command has noticed it."""
    what, _, change = said.event.rpartition("-")
    if call.out.json_lines:
        record = {"event": said.event, "unit": unit_json(said.unit), "at_us": said.at_us, "what": said.what}
        call.out.line({**record, "by": None if by is None else unit_json(by)})
        return
    about = said.unit if said.what is None else f"{said.what} of {said.unit}"
    words = line(f"{what} {about}  ", styled(change, _COLOURS.get(change, "")))
    call.out.aside(clock_time(said.at_us), words if by is None else line(words, styled(f"  seen by {by}", "dim")))
