"""From words on the command line to the content of an act: `create-multicast sample-period=1s to-units=0,1`."""

from collections.abc import Sequence
from typing import Any, get_args, get_origin

from pydantic import ValidationError

from console.errors import WrongCall, did_you_mean
from console.instants import duration_us, instant_us
from federation.contents import (
    CheckFormula,
    Content,
    CreateMonitor,
    CreateMulticast,
    Goto,
    Hold,
    Land,
    Leave,
    MonitorProximity,
    Rejoin,
    RemoveMonitor,
    Resume,
    ReturnHome,
    StopMulticast,
)

TASKS: dict[str, type[Content]] = {
    kind.head: kind
    for kind in (
        MonitorProximity,
        CreateMulticast,
        StopMulticast,
        CreateMonitor,
        RemoveMonitor,
        CheckFormula,
        Goto,
        Hold,
        Land,
        ReturnHome,
        Resume,
        Leave,
        Rejoin,
    )
}
_INNER = {CreateMonitor.head: ("coordinator", "delegator", "generation", "parameters", "profile", "task")}
"""What platforms tell each other about a task, or refuse in every case, and nobody types."""
_WORDS = {"true": True, "yes": True, "on": True, "false": False, "no": False, "off": False}


def content_of(task: str, pairs: Sequence[str], now_us: int) -> Content:
    """The content that delegates `task` with these `key=value` pairs.

    Durations take suffixes, times are instants as everywhere on the command line, lists have commas.

    Raises:
        WrongCall: an unknown task or key, a value that does not fit; with the remedy.
    """
    kind = TASKS.get(task)
    if kind is None:
        raise WrongCall(f"TASK: nobody understands {task!r}.{did_you_mean(task, tuple(TASKS))}")
    names = {field.alias or name: name for name, field in kind.model_fields.items() if name not in _INNER.get(task, ())}
    given: dict[str, Any] = {}
    for pair in pairs:
        key, equals, text = pair.partition("=")
        if not equals:
            raise WrongCall(f"{pair!r}: write key=value; {_keys(task, names)}")
        if key not in names:
            raise WrongCall(
                f"{task} has no {key!r}.{did_you_mean(key, tuple(names)) if names else ' It takes nothing.'}"
            )
        given[key] = _value(key, names[key], kind.model_fields[names[key]].annotation, text, now_us)
    try:
        return kind.model_validate(given)
    except ValidationError as error:
        said = [_sentence(task, mistake["loc"], mistake["type"], mistake["msg"]) for mistake in error.errors()]
        raise WrongCall("\n".join([*said, _keys(task, names)])) from None


def _keys(task: str, names: dict[str, str]) -> str:
    return f"{task} takes {', '.join(f'{key}=...' for key in names) or 'nothing'}"


def _sentence(task: str, place: Sequence[int | str], kind: str, message: str) -> str:
    key = ".".join(str(part) for part in place)
    return f"{task} needs {key}=..." if kind == "missing" else f"{key}: {message}"


def _value(key: str, name: str, annotation: Any, text: str, now_us: int) -> Any:
    """The value that a field of this type and name has; quantities end in `_s`, `_us` or their unit."""
    kinds = _kinds(annotation)
    if tuple in kinds:
        return tuple(part.strip() for part in text.split(",") if part.strip())
    if name.endswith("_us"):
        return instant_us(text, now_us, option=key)
    if name.endswith("_s"):
        return duration_us(text, option=key) / 1e6
    if bool in kinds:
        if text.lower() not in _WORDS:
            raise WrongCall(f"{key}: {text!r} is neither true nor false.")
        return _WORDS[text.lower()]
    if int in kinds or float in kinds:
        try:
            return int(text) if int in kinds else float(text)
        except ValueError:
            raise WrongCall(f"{key}: {text!r} is not a number.") from None
    return text


def _kinds(annotation: Any) -> set[Any]:
    """The plain types in an annotation such as `tuple[str, ...] | None`."""
    origin = get_origin(annotation)
    if origin is tuple:
        return {origin}
    parts = get_args(annotation)
    return {kind for part in parts for kind in _kinds(part)} if parts else {annotation}
