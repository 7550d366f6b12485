"""Actions of users on the page, as speech acts: tasks are delegated and ended, questions of missions answered."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from dyknow.console.picture.rows import text
from dyknow.console.web.actions import Done
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import AnswerQuestion, ControlMission
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.model.errors import DyknowError, FederationFailed, WrongCall
from dyknow.runtime.client import Client, Job, Wait
from dyknow.runtime.library.jobs import begin_task, failure_of, running_already
from dyknow.runtime.library.listings import cancel
from dyknow.runtime.library.missions import abort_mission

ANSWER_S: Final = 3.0
MOST_VALUES: Final = 32


def job_of(client: Client, given: Mapping[str, Any]) -> Job[Done]:
    """The job that a request describes.

    Raises:
        WrongCall: it is nothing that can be done.
    """
    match given:
        case {"do": "delegate", "task": str(task), "to": str() | None as to, "with": dict(values)}:
            return _delegate(client, task, to or None, _texts(values))
        case {"do": "cancel", "conversation": str(conversation)}:
            return _cancel(client, conversation)
        case {"do": "answer", "unit": str(unit), "mission": str(mission), "number": int(number), "answer": str(answer)}:
            return _control(client, unit, lambda: AnswerQuestion(mission=mission, number=number, answer=answer))
        case {"do": "mission", "mission": str(mission), "how": "abort"}:
            return _abort(client, mission)
        case {"do": "mission", "unit": str(unit), "mission": str(mission), "how": str(how)}:
            return _control(client, unit, lambda: ControlMission.model_validate({"mission": mission, "how": how}))
    raise WrongCall("the page asks for what this program does not know; reload it.")


def _texts(values: Mapping[str, Any]) -> dict[str, str]:
    if len(values) > MOST_VALUES or not all(isinstance(each, str) for each in values.values()):
        raise WrongCall("the values of a task are texts; reload the page.")
    return dict(values)


def _delegate(client: Client, task: str, to: str | None, values: Mapping[str, str]) -> Job[Done]:
    running = yield from running_already(client, task, to, values)
    if running is not None:
        return {"said": f"runs already on platform {running.unit}", "conversation": running.conversation}
    dialogue = yield from begin_task(client, task, to, values, ANSWER_S)
    yield Wait(lambda: bool(dialogue.said or dialogue.over), ANSWER_S)
    return _answered(dialogue)


def _cancel(client: Client, conversation: str) -> Job[Done]:
    ends = yield from cancel(client, conversation)
    return {"said": f"ended on platform {', '.join(end.unit for end in ends)}"}


def _control(client: Client, unit: str, content: Callable[[], AnswerQuestion | ControlMission]) -> Job[Done]:
    try:
        said = content()
    except ValueError as wrong:
        raise WrongCall(text(wrong)) from None
    client.pick(unit)
    dialogue = client.say(unit, Performative.REQUEST, said, within_s=ANSWER_S)
    yield Wait(lambda: bool(dialogue.results or dialogue.over), ANSWER_S)
    return _answered(dialogue)


def _abort(client: Client, mission: str) -> Job[Done]:
    found = yield from abort_mission(client, mission)
    if found.unsure:
        texts = "; ".join(f"platform {unit}: {why}" for unit, why in found.unsure.items())
        raise FederationFailed(f"mission {mission} may continue there, take the vehicle by hold: {texts}")
    return {"said": f"ended at platform {', '.join(found.ended)}"}


def _answered(dialogue: Dialogue) -> Done:
    """The platform's answer; raises what it has not agreed to."""
    if not dialogue.said:
        raise FederationFailed(f"platform {dialogue.unit}: {dialogue.trouble or 'no answer in time'}")
    answers = {act.performative for act, _ in dialogue.said}
    if answers & {Performative.REFUSE, Performative.FAILURE, Performative.NOT_UNDERSTOOD}:
        raise failure_of(dialogue, "it was not done")
    return {"said": f"platform {dialogue.unit} agrees", "conversation": dialogue.conversation}


def told(error: BaseException) -> DyknowError:
    """The error as one of ours."""
    return error if isinstance(error, DyknowError) else FederationFailed("the connection to the federation has ended.")
