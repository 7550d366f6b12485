"""`dyknow acts`: the message log of the interface agents, an act a line."""

from collections.abc import Iterable
from typing import Annotated

import typer

from dyknow.console.arguments import Follow, Unit
from dyknow.console.centre.client import connected
from dyknow.console.command import Call, command
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import unit_json
from dyknow.console.output.shown import Shown, line, styled
from dyknow.federation.messages.acts import Act, Performative, parse_act
from dyknow.federation.messages.contents import ActList, ActLog, Acts
from dyknow.model.errors import TextError
from dyknow.runtime.client import Client
from dyknow.runtime.configuration.instants import clock_time
from dyknow.runtime.library.jobs import Subscriptions, lists

_STEP_S = 0.2
_QUESTIONS = {Performative.QUERY_REF, Performative.SUBSCRIBE}
_FINE = {"accepted", "sent"}


class _Log:
    """Prints entries of the message log, each act once; `is_whole`: also questions, their answers and both copies."""

    def __init__(self, call: Call, *, full: bool, is_whole: bool) -> None:
        self._call, self._full, self._is_whole = call, full, is_whole
        self._questions: set[str] = set()
        self._shown: set[tuple[object, ...]] = set()
        self.count = 0

    def chosen(self, entries: Iterable[tuple[str, ActLog]]) -> list[tuple[str, ActLog, Act | None]]:
        """Those to be printed. JSON lines have them all."""
        if self._call.out.json_lines:
            return [(unit, log, None) for unit, log in entries]
        return [(unit, log, act) for unit, log in entries if self._is_shown(log, act := _act(log)) or self._is_whole]

    def _is_shown(self, log: ActLog, act: Act | None) -> bool:
        if act is None:  # its text was too long to be kept, as of this command's own answers, or it was no act
            return log.outcome not in _FINE
        if act.performative in _QUESTIONS and act.conversation_id is not None:
            self._questions.add(act.conversation_id)
        name = (act.sender, act.receiver, act.performative, act.conversation_id, act.in_reply_to, str(act.content))
        is_news = name not in self._shown or log.outcome not in _FINE
        self._shown.add(name)
        return is_news and act.conversation_id not in self._questions

    def show(self, entries: Iterable[tuple[str, ActLog, Act | None]]) -> None:
        for unit, log, act in entries:
            self.count += 1
            if self._call.out.json_lines:
                self._call.out.line(_json(unit, log))
            else:
                _tell(self._call, unit, log, act, full=self._full)


@command(example="dyknow acts --unit 0 --last 20")
def acts(
    call: Call,
    *,
    follow: Follow = False,
    unit: Unit = None,
    last: Annotated[int | None, typer.Option(metavar="N", min=1, help="Only the last N so far.")] = None,
    full: Annotated[bool, typer.Option("--full", help="Each act whole, as FIPA writes it.")] = False,
    is_whole: Annotated[
        bool, typer.Option("--all", help="Questions and their answers too, and each act at both of its ends.")
    ] = False,
) -> int:
    """The message log: an act a line, and its outcome; exit 1 if there are none. With --follow from now on only."""
    log = _Log(call, full=full, is_whole=is_whole)
    with connected(call) as client:
        units = _units(client, unit, follow=follow)
        if not follow or last is not None:
            remembered = client.run(lists(client, units, ActList(), ActList))
            known = [(by, one) for by, said in remembered for one in said.acts or ()]
            shown = log.chosen(sorted(known, key=lambda entry: entry[1].at_us))
            log.show(shown[-last:] if last is not None else shown)
        if follow:
            subscriptions = Subscriptions(client, Acts())
            while True:
                news = client.run(subscriptions.news(_STEP_S))
                log.show(log.chosen((by, said) for by, said in news if isinstance(said, ActLog) and unit in {None, by}))
        elif not log.count and not call.out.json_lines:
            call.out.note("no act but questions and their answers; --all shows those.")
    return DONE if log.count else NO


def _units(client: Client, unit: str | None, *, follow: bool) -> list[str]:
    """The platforms to ask; with `follow` there may be none yet."""
    if follow and unit is None:
        return [seen.unit for seen in client.settle()]
    return client.chosen(unit)


def _act(log: ActLog) -> Act | None:
    try:
        return None if log.act is None else parse_act(log.act)
    except TextError:
        return None


def _json(unit: str, log: ActLog) -> dict[str, object]:
    return {
        "unit": unit_json(unit),
        "at_us": log.at_us,
        "direction": log.direction,
        "peer": unit_json(log.peer),
        "outcome": log.outcome,
        "act": log.act,
    }


def _tell(call: Call, unit: str, log: ActLog, act: Act | None, *, full: bool) -> None:
    good = log.outcome in _FINE
    outcome: Shown = "" if good else styled(f"  {log.outcome}", "yellow")
    when, sender, receiver = clock_time(log.at_us), log.peer, unit
    if log.direction == "out":
        sender, receiver = unit, log.peer
    whom, how = f"  {sender} -> {receiver}", "" if act is None else act.performative.value
    room = call.out.width - len(when) - len(whom) - len(how) - len(str(outcome)) - 3
    what = "" if act is None else _summary(act, room)
    act_shown = line("  ", styled(how, "bold"), f" {what}" if what else "") if how else ""
    call.out.show(styled(when, "dim"), whom, act_shown, outcome)
    if full and log.act is not None:
        # Without what only its delivery needs.
        text = log.act if act is None else str(act._replace(boot=0, seq=0, created_us=0, acks=()))
        call.out.show(styled(text, "dim"))


def _summary(act: Act, room: int) -> str:
    """A summary of its content in `room` characters: the head and the texts in it, `create-monitor proximity`."""
    if act.content is None:
        return ""
    words = [str(value) for value in act.content.arguments.values() if isinstance(value, str)]
    summary = " ".join([act.content.head, *words])
    return summary if len(summary) <= room else f"{summary[: max(0, room - 3)]}..."
