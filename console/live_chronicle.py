"""`dyknow chronicle --unit U`: chronicles over the live streams of a platform."""

import time
from pathlib import Path

from console.chronicle import chronicles_of
from console.client import connected
from console.command import Call
from console.dialogue import failure_of
from console.errors import DONE, NO, WrongCall
from console.instants import clock_time
from console.output import unit_json, verbatim
from federation.acts import Performative
from federation.contents import Content, Reason, Recognise, Recognised
from federation.contents.chronicles import LONGEST

_STEP_S = 0.2


def watch(call: Call, file: Path, *, unit: str, seconds: float, delay_s: float | None) -> int:
    """0 if something was recognised, 1 if nothing; each instance as it becomes certain."""
    text, _ = chronicles_of(file)
    if len(text) > LONGEST:
        raise WrongCall(f"{file} is too long to be sent: {len(text)} characters, {LONGEST} are the most.")
    count = heard = 0
    with connected(call) as client:
        client.chosen(unit)
        content = Recognise(text=text, timeout_s=seconds + 5.0, delay_s=delay_s)
        dialogue = client.say(unit, Performative.SUBSCRIBE, content, standing=True)

        def has_news() -> bool:
            return len(dialogue.results) > heard or dialogue.trouble is not None

        until_s = time.monotonic() + seconds
        while (left_s := until_s - time.monotonic()) > 0 and dialogue.trouble is None:
            client.wait_for(has_news, min(left_s, _STEP_S))
            new = dialogue.results[heard:]
            heard += len(new)
            count += sum(_tell(call, unit, said) for said in new)
        if dialogue.trouble is not None:
            raise failure_of(dialogue, "the watch ended")
    if not count:
        call.out.note(f"nothing was recognised on platform {unit} within {seconds:g} s.")
    return DONE if count else NO


def _tell(call: Call, unit: str, said: Content) -> bool:
    """Whether it is an instance."""
    from reasoning.chronicles.changes import symbol

    if isinstance(said, Reason):
        call.out.note(f"note: {said.text}")
    if not isinstance(said, Recognised):
        return False
    instants = {name: int(str(at_us)) for name, at_us in said.instants.items()}
    bindings = {name: symbol(found) for name, found in said.bindings.items()}
    words = [f"{name}={found}" for name, found in bindings.items()]
    words += [f"{name}={clock_time(at_us)}" for name, at_us in instants.items()]
    call.out.say(
        f"{clock_time(said.recognised_us)}  [bold]{verbatim(said.chronicle)}[/bold]  {verbatim(' '.join(words))}",
        unit=unit_json(unit),
        chronicle=said.chronicle,
        bindings=bindings,
        instants={name: _ms(at_us) for name, at_us in instants.items()},
        recognised_ms=_ms(said.recognised_us),
    )
    return True


def _ms(at_us: int) -> int:
    return at_us // 1000
