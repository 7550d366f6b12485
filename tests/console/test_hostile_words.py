"""Whatever platforms say in whatever field, no command obeys it, none ends of it, and the terminal gets plain text.

The fields are those of the contents' table, the commands those of the recorded transcripts: a content or a command that is
new is fed as soon as it is there.
"""

import json
import shutil
import sys
from collections.abc import Iterator
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from dyknow.agents.effects import Impaired
from dyknow.console.centre import client
from dyknow.console.main import COMMANDS, app
from dyknow.federation import keys
from dyknow.federation.messages import contents
from dyknow.federation.messages.codec import decode_act, decode_samples, encode_act, encode_samples
from dyknow.federation.messages.contents import ContentPart, read
from dyknow.federation.messages.sexpr import Expr, QuotedText
from dyknow.federation.transport import Put
from dyknow.model.errors import ContentError
from tests.box import Box
from tests.console.test_transcripts import TRANSCRIPTS, worlds

CONTROLS = "\x1b]0;t\x07\x1b[2J\x9b1m\r\x08\u202e\u2066"
MARKUP = "[/][red]r[/red][link=http://e]c[/link]:bomb:"
SESSIONS = json.loads((TRANSCRIPTS / "members.json").read_text(encoding="utf-8"))
LOCAL = {
    "up", "join", "host", "down", "demo", "doctor", "kpl", "kpl check", "kpl run", "kpl verify", "ontology", "ontology check",
    "link", "mission", "world", "match", "recover", "plan", "roads", "roads check", "roster", "roster init", "roster add", "roster revoke", "roster show",
}  # fmt: skip
"""Commands that ask no platform: they show records and files, by the same output."""
FREE = {
    ("act-log", "act"), ("act-log", "outcome"), ("act-log", "peer"), ("alarm", "id"), ("alarm", "monitor"), ("because", "part"),
    ("because", "within"), ("done", "text"), ("monitor", "name"), ("monitor", "shows"), ("monitor", "states"), ("monitor", "which"),
    ("progress", "step"), ("reason", "code"), ("reason", "text"), ("task", "state"), ("task", "task"), ("verdict", "missing"),
    ("verdict", "no-value"), ("verdict", "states"), ("record", "values"), ("record", "value"),
}  # fmt: skip
"""Fields of answers that carry any words, and reached a command here."""
PARTS = {
    found.head: found
    for found in (getattr(contents, name) for name in contents.__all__)
    if isinstance(found, type) and issubclass(found, ContentPart) and hasattr(found, "head")
}


def leaves(expr: Expr, path: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], Expr]]:
    """Every place of a string, and every part that may have more fields."""
    yield path, expr

    def inside(value: Any, at: tuple[Any, ...]) -> Iterator[tuple[tuple[Any, ...], Expr]]:
        if isinstance(value, Expr):
            yield from leaves(value, at)
        elif isinstance(value, dict):
            yield at, Expr("record")
        elif isinstance(value, tuple):
            for number, member in enumerate(value):
                yield from inside(member, (*at, number))
        elif isinstance(value, str):
            yield at, expr

    for name, value in expr.arguments.items():
        yield from inside(value, (*path, name))


def put(value: Any, path: tuple[Any, ...], word: Any) -> Any:
    """The same value with `word` at that place."""
    if not path:
        return word
    first, *rest = path
    if isinstance(value, Expr):
        inner = put(value.arguments[first], tuple(rest), word) if rest else word
        return Expr(value.head, {**value.arguments, first: inner})
    if isinstance(value, dict):
        return {**value, first: word}
    return tuple(put(each, tuple(rest), word) if at == first else each for at, each in enumerate(value))


class HostileWorld:
    """A world whose platforms answer commands with every word replaced that the contents' models let pass."""

    def __init__(self, world: Box) -> None:
        self.world, self._numbers = world, count(1)
        self.fed: set[tuple[str, str]] = set()
        self._put, world.wire._perform[Put] = world.wire._perform[Put], self._spoilt
        for unit, platform in world.platforms.items():
            platform.on_event(Impaired(world.now_us, f"{CONTROLS}{MARKUP}"), world.now_us)
            world.settle(unit)
        world.run(0.5)

    def _spoilt(self, session: Any, effect: Put) -> None:
        key = keys.parse_key(effect.key)
        if isinstance(key, keys.ActKey) and key.sender in self.world.platforms and key.agent == "interface":
            act = decode_act(effect.payload)[0]
            if key.receiver.startswith("cc") and act.content is not None:
                effect = effect._replace(payload=encode_act(act._replace(content=self.spoil(act.content))))
        self._put(session, effect)

    def spoil(self, content: Expr) -> Expr:
        for path, part in list(leaves(content)):
            if part.head != "record" and path and not isinstance(_at(content, path), Expr):
                content = self._fed(content, path, part.head, _named(path))
                continue
            if part.head == "record":
                content = self._fed(
                    content, (*path, f"{next(self._numbers)}{CONTROLS}{MARKUP}"), part.head, _named(path)
                )
            model = PARTS.get(part.head)
            for field in model.model_fields.values() if model is not None else ():
                if field.alias is not None and field.alias not in part.arguments:
                    content = self._fed(content, (*path, field.alias), part.head, field.alias)
        return content

    def _fed(self, content: Expr, path: tuple[Any, ...], head: str, field: str) -> Expr:
        number = next(self._numbers)
        for word in (f"{number}{CONTROLS}{MARKUP}"[:64], f"{number}{MARKUP}"[:64]):
            for value in (word, QuotedText(word), 1.5, (word,), {word: word}):
                spoilt: Expr = put(content, path, value)
                try:
                    read(spoilt)
                except ContentError:
                    continue
                self.fed.add((head, field))
                return spoilt
        return content


def _at(value: Any, path: tuple[Any, ...]) -> Any:
    for step in path:
        value = value.arguments[step] if isinstance(value, Expr) else value[step]
    return value


def _named(path: tuple[Any, ...]) -> str:
    return next(str(step) for step in reversed(path) if isinstance(step, str))


def _client_ports(world: Box, _call: Any) -> Any:
    return world.client_ports()


def commanding(text: str) -> list[str]:
    """The characters of an output that a terminal would not show."""
    return [char for char in text if not char.isprintable() and char not in "\n\t"]


def test_no_command_obeys_what_platforms_say(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(shutil.copytree(TRANSCRIPTS / "inputs", tmp_path / "inputs"))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setenv("COLUMNS", "100")
    fed, shown = set(), ""
    for session in SESSIONS:
        hostile = HostileWorld(worlds()[session["world"]]())
        monkeypatch.setattr(client, "_client_ports", partial(_client_ports, hostile.world))
        for step in session["steps"]:
            if "run" in step:
                shown += run(step["run"], hostile.world, capsys, monkeypatch)
            else:
                hostile.world.run(step["seconds"])
        fed |= hostile.fed
    hostile = HostileWorld(worlds()["three"]())
    monkeypatch.setattr(client, "_client_ports", partial(_client_ports, hostile.world))
    hostile.world.agenda.at(hostile.world.now_us + 2_000_000, hostile.world.kill, "0")
    shown += run(["delegate", "monitor-proximity", "--to", "0", "--wait"], hostile.world, capsys, monkeypatch)
    fed |= hostile.fed
    assert fed >= FREE, FREE - fed
    assert MARKUP in shown, "brackets are shown as they are"
    assert "\\x1b[2J" in shown


def run(words: list[str], world: Box, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> str:
    """What a command prints, as text and as JSON."""
    conversations = [each for platform in world.platforms.values() for each in platform.built.tasks.coordinated]
    words = [word.replace("CONVERSATION", next(iter(conversations), "cc-1")) for word in words]
    printed = ""
    for style in ([], ["--json"]):
        monkeypatch.setattr(sys, "argv", ["dyknow", *words, "--federation", "test", *style])
        with pytest.raises(SystemExit):
            app(prog_name="dyknow")
        shown = capsys.readouterr()
        assert commanding(shown.out) == commanding(shown.err) == [], (words, shown)
        printed += shown.out + shown.err
    return printed


def test_a_stream_of_words_is_watched_as_plain_text(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setenv("COLUMNS", "300")
    world = worlds()["three"]()
    monkeypatch.setattr(client, "_client_ports", partial(_client_ports, world))
    put = world.wire._perform[Put]

    def spoilt(session: Any, effect: Put) -> None:
        if isinstance(keys.parse_key(effect.key), keys.StreamKey):
            boot, samples, riders, _ = decode_samples(effect.payload)
            words = [each._replace(value=f"{CONTROLS}{MARKUP}") for each in samples]
            effect = effect._replace(payload=encode_samples(boot, words, riders=riders))
        put(session, effect)

    world.wire._perform[Put] = spoilt
    watched = ["watch", "heli-position", "--unit", "0", "--count", "1"]
    world.agenda.at(world.now_us + 10_000_000, world.kill, "0")
    shown = run(watched, world, capsys, monkeypatch)
    assert MARKUP in shown
    assert "\\x1b[2J" in shown


def test_every_command_that_asks_platforms_was_run() -> None:
    run = {
        " ".join(step["run"][: 2 if step["run"][0] in {"kpl", "mission", "ontology", "roads"} else 1])
        for s in SESSIONS
        for step in s["steps"]
        if "run" in step
    }
    assert set(COMMANDS) - run <= LOCAL
