"""The picture that platforms have together: a line for each object, with the platforms that see it."""

from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple

from dyknow import NO_VALUE, US_PER_MS, US_PER_S, as_json
from dyknow.console.command import Call
from dyknow.console.output.output import unit_json
from dyknow.federation.messages.contents import ObjectPicture, PictureEntry
from dyknow.model.instants import print_span
from dyknow.runtime.client import Client
from dyknow.runtime.library.jobs import lists

NEW_US: Final = 20 * US_PER_S
LOOK_S: Final = 0.3
OF_OBJECTS: Final = frozenset({"object-tracks", "believed-objects"})
"""Labels of platforms that tell of objects."""


class JointPicture(NamedTuple):
    """The platforms that take part, and the objects by name, each as the platform has it that saw it last."""

    members: frozenset[str]
    objects: Mapping[str, PictureEntry]


class FirstObjects:
    """How long to wait for the first object of new platforms: a new object has no name for two seconds."""

    def __init__(self, client: Client) -> None:
        self._client, self._until_us = client, client.now_us() + NEW_US

    def may_come(self) -> bool:
        """Wait a little, if a platform that tells of objects began `NEW_US` ago or later; False: there is none to wait for."""
        now_us = self._client.now_us()
        began_us = [
            view.entry.boot * US_PER_MS
            for view in self._client.centre.platforms()
            if view.entry is not None and OF_OBJECTS.intersection(view.labels)
        ]
        if now_us >= self._until_us or not any(abs(now_us - each) < NEW_US for each in began_us):
            return False
        self._client.wait_for(lambda: False, LOOK_S)
        return True


def joint_picture(client: Client) -> JointPicture | None:
    """Ask all platforms; None: none of them has a picture."""
    units = [view.unit for view in client.centre.platforms()]
    answers: Iterable[tuple[str, ObjectPicture]] = client.run(lists(client, units, ObjectPicture(), ObjectPicture))
    members, objects = set[str](), dict[str, PictureEntry]()
    for _, said in answers:
        members.update(said.members or ())
        for each in said.objects or ():
            known = objects.get(each.symbol)
            if known is None or (each.seen_us, len(each.by)) > (known.seen_us, len(known.by)):
                objects[each.symbol] = each
    return JointPicture(frozenset(members), dict(sorted(objects.items()))) if members else None


def show(call: Call, picture: JointPicture, now_us: int) -> None:
    """All of it, a line each."""
    if call.out.json_lines:
        for entry in picture.objects.values():
            call.out.line(record(entry))
    elif picture.objects:
        rows = [
            (entry.symbol, ", ".join(entry.by) or "none", *_age_and_place(entry, now_us), _names(entry))
            for entry in picture.objects.values()
        ]
        call.out.table("", ("object", "seen by", "age", "place", "sd", "called"), rows, whole=("object",))
    else:
        call.out.note(f"platforms {', '.join(sorted(picture.members))} have one picture, and no object is in it yet.")


def tell_changes(call: Call, before: JointPicture | None, after: JointPicture, now_us: int) -> None:
    """Report changes since `before`: platforms and objects that come and go, and which platforms see each."""
    members = after.members if before is None else before.members
    for unit in sorted(members ^ after.members):
        _tell_member(call, unit, "arrived" if unit in after.members else "departed")
    objects = {} if before is None else before.objects
    for name, entry in after.objects.items():
        known = objects.get(name)
        if known != entry:
            event = "appeared" if known is None else "lost" if known.by and not entry.by else ""
            _tell(call, entry, now_us, "reacquired" if known is not None and entry.by and not known.by else event)
    for name in objects.keys() - after.objects.keys():
        _tell(call, objects[name], now_us, "vanished")


def record(entry: PictureEntry) -> dict[str, Any]:
    """One object, for `--json`."""
    return {
        "symbol": entry.symbol,
        "by": [unit_json(unit) for unit in entry.by],
        "seen_us": entry.seen_us,
        "tracks": list(entry.tracks),
        "others": list(entry.others),
        **{name: as_json(value) for name, value in entry.attributes.items()},
    }


def _tell_member(call: Call, unit: str, event: str) -> None:
    if call.out.json_lines:
        call.out.line({"unit": unit_json(unit), "event": event})
    else:
        call.out.show(f"platform {unit}  {event}")


def _tell(call: Call, entry: PictureEntry, now_us: int, event: str) -> None:
    if call.out.json_lines:
        call.out.line({**record(entry), **({"event": event} if event else {})})
    else:
        age, place, deviation = _age_and_place(entry, now_us)
        by = f"by {', '.join(entry.by)}" if entry.by else "by none"
        call.out.show(f"{entry.symbol}  {by}  {event or age}  {place}  {deviation}")


def _age_and_place(entry: PictureEntry, now_us: int) -> tuple[str, str, str]:
    found = entry.attributes
    place = f"({_number(found.get('x_m'))}, {_number(found.get('y_m'))}) m"
    return print_span(max(0, now_us - entry.seen_us)), place, f"{_number(found.get('sd_m'))} m"


def _number(value: Any) -> str:
    return f"{value:.1f}" if isinstance(value, int | float) and value is not NO_VALUE else "?"


def _names(entry: PictureEntry) -> str:
    return " ".join(entry.tracks) + (f" (also {' '.join(entry.others)})" if entry.others else "")
