"""`dyknow objects`: the objects that platforms see: one picture of them all, or each platform's own with their newest states."""

from collections.abc import Container, Iterable
from typing import Annotated, Any, TypeAlias

import typer

from dyknow import NO_VALUE, as_json
from dyknow.console.centre.client import connected
from dyknow.console.command import Call, command
from dyknow.console.commands.objects.picture import FirstObjects, JointPicture, joint_picture, show, tell_changes
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import unit_json
from dyknow.federation.messages.contents import ObjectEntry, ObjectList
from dyknow.model.instants import print_span
from dyknow.runtime.client import Client
from dyknow.runtime.library.jobs import lists

EVERY_S = 1.0
EXISTENCE, TYPES, SEEN_BY = "existence", "types", "seen_by"
_COLUMNS = frozenset({EXISTENCE, TYPES, SEEN_BY})
"""Attributes that have columns of their own."""
Key: TypeAlias = tuple[str, str, str]
"""Platform, stream and symbol."""


@command(example="dyknow objects --type car --follow")
def objects(
    call: Call,
    *,
    type_: Annotated[str | None, typer.Option("--type", metavar="T", help="Of one type, or one stream, only.")] = None,
    unit: Annotated[str | None, typer.Option("--unit", metavar="U", help="Of one platform only.")] = None,
    follow: Annotated[bool, typer.Option("--follow", "-f", help="Also those that appear, move and vanish.")] = False,
) -> int:
    """The objects that platforms see, a line each; exit 1 if there is none.

    Platforms that export object-tracks have one picture, with one line for each object and the platforms that see it; with
    --unit or --type it is what platforms see each for themselves. While there is none and a platform has just started, it waits.
    """
    with connected(call) as client:
        units, first = client.chosen(unit), FirstObjects(client)
        while unit is None and type_ is None and (picture := joint_picture(client)) is not None:
            if follow or picture.objects or not first.may_come():
                return _picture(call, client, picture, follow=follow)
        seen: dict[Key, ObjectEntry] = {}
        while True:
            found = _listed(client.run(lists(client, units, ObjectList(type=type_), ObjectList)))
            if not follow:
                if not found and first.may_come():
                    continue
                _show(call, found, client.federation_us())
                if not found:
                    others = client.run(lists(client, units, ObjectList(), ObjectList)) if type_ else ()
                    _tell_none(call, type_, _listed(others))
                break
            for key, entry in found.items():
                if seen.get(key) != entry:
                    _tell(call, key, entry, client.federation_us(), "" if key in seen else "appeared")
            for key in seen.keys() - found.keys():
                _tell(call, key, seen[key], client.federation_us(), "vanished")
            seen = found
            client.wait_for(lambda: False, EVERY_S)
    return DONE if found else NO


def _picture(call: Call, client: Client, picture: JointPicture, *, follow: bool) -> int:
    """The picture, and what changes in it."""
    if not follow:
        show(call, picture, client.federation_us())
        return DONE if picture.objects else NO
    before: JointPicture | None = None
    while True:
        tell_changes(call, before, picture, client.federation_us())
        before = picture
        client.wait_for(lambda: False, EVERY_S)
        picture = joint_picture(client) or JointPicture(frozenset(), {})


def _listed(answers: Iterable[tuple[str, ObjectList]]) -> dict[Key, ObjectEntry]:
    entries = ((unit, each) for unit, said in answers for each in said.objects or ())
    return dict(sorted(((unit, each.stream, each.symbol), each) for unit, each in entries))


def _show(call: Call, found: dict[Key, ObjectEntry], now_us: int) -> None:
    if call.out.json_lines:
        for key, entry in found.items():
            call.out.line(_record(key, entry))
    elif found:
        believed = any(EXISTENCE in entry.attributes for entry in found.values())
        rows = [
            (unit, entry.symbol, *_believed(entry, believed), entry.stream, *_state(entry, now_us, _COLUMNS))
            for (unit, _, _), entry in found.items()
        ]
        belief = ("type", EXISTENCE, "seen by") if believed else ("type",)
        call.out.table("", ("by", "object", *belief, "stream", "age", "state"), rows, whole=("object",))


def _tell_none(call: Call, type_: str | None, others: dict[Key, ObjectEntry]) -> None:
    """Report that there are no objects, or none of a type, and which other types there are."""
    types = sorted({name for each in others.values() for name in (each.type, each.stream)})
    if types:
        call.out.note(f"no platform sees an object of {type_}; there are objects of {', '.join(types)}.")
    else:
        call.out.note(
            "no platform sees an object: they are in streams of object states, sort car(symbol in text, x_m in m, ...)."
        )


def _believed(entry: ObjectEntry, believed: bool) -> tuple[str, ...]:
    """The type, or its distribution; where existence is believed in, also that and the platforms that see it."""
    types, existence, seen_by = (entry.attributes.get(name, NO_VALUE) for name in (TYPES, EXISTENCE, SEEN_BY))
    type_ = types if isinstance(types, str) and types else entry.type
    if not believed:
        return (type_,)
    return (
        type_,
        f"{existence:.3f}" if isinstance(existence, int | float) else "",
        (seen_by or "none") if isinstance(seen_by, str) else "",
    )


def _tell(call: Call, key: Key, entry: ObjectEntry, now_us: int, event: str) -> None:
    if call.out.json_lines:
        call.out.line({**_record(key, entry), **({"event": event} if event else {})})
    else:
        age, state = _state(entry, now_us)
        call.out.show(f"{entry.symbol}  {entry.type} by {key[0]}  {event or age}  {state}")


def _state(entry: ObjectEntry, now_us: int, without: Container[str] = ()) -> tuple[str, str]:
    values = (
        f"{name} {value:g}" if isinstance(value, float) else f"{name} {value}"
        for name, value in _shown(entry)
        if name not in without
    )
    return print_span(max(0, now_us - entry.valid_us)), ", ".join(values)


def _shown(entry: ObjectEntry) -> Iterable[tuple[str, Any]]:
    return ((name, value) for name, value in entry.attributes.items() if value is not False and value is not NO_VALUE)


def _record(key: Key, entry: ObjectEntry) -> dict[str, Any]:
    """One object, for `--json`."""
    return {
        "unit": unit_json(key[0]),
        "symbol": entry.symbol,
        "type": entry.type,
        "stream": entry.stream,
        "valid_us": entry.valid_us,
        **{name: as_json(value) for name, value in entry.attributes.items()},
    }
