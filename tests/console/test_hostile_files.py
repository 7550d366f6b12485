"""Files from anyone, given to every command that reads one: a sentence with the file's name and an exit code, at a bounded cost.

Which options and arguments name files is read off the commands themselves; one that is new fails here until it has a call.
"""

import inspect
import json
import multiprocessing
import os
import resource
import struct
import sys
import time
from collections.abc import Callable, Iterator
from functools import cache
from importlib import import_module
from itertools import product
from multiprocessing.connection import Connection
from pathlib import Path
from random import Random
from typing import Any, NamedTuple, get_args

import lz4.frame
import pytest

from dyknow.console.command import _common
from dyknow.console.main import COMMANDS, app
from dyknow.federation.security.trust import Roster, RosterMember, Signer
from dyknow.model.errors import SessionFailed
from dyknow.runtime.recordings.recording_file import SAMPLE, RecordingFile
from tests.anchoring.belief.files.test_models import MODEL
from tests.runtime.recordings.test_bombs import archives, channel, chunk, mcap, message, refuse_unpickling

FORK = multiprocessing.get_context("fork")
FULL = bool(os.environ.get("DYKNOW_FULL"))
ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
MOST_S, MOST_MB, MOST_CHARACTERS = 5.0, 100.0, 20_000
SIZE = 1_000_000
FILE = "FILE"
"""Stands in a call for the hostile file."""
SPEC, FEED = str(EXAMPLES / "first.kpl"), str(EXAMPLES / "first.jsonl")
DOMAIN, PROBLEM = str(EXAMPLES / "missions/survey.dom"), str(EXAMPLES / "missions/one.prob")
LINK, PERCEPTS, ROADS = (
    str(EXAMPLES / each) for each in ("objects/link.kpl", "objects/percepts.jsonl", "roads/town.geojson")
)

WRITTEN = {
    ("check", "plot"), ("world", "learn"), ("record", "file"), ("info", "mended"), ("plot", "to"), ("plan", "pddl"), ("kpl run", "record"),
    ("web", "tiles"),
}  # fmt: skip
"""What names a file that is written, or a folder."""
CALLS: dict[tuple[str, str], tuple[str, list[str]]] = {
    ("up", "spec"): (".kpl", ["up", "1", "--spec", FILE]),
    ("up", "feed"): (".jsonl", ["up", "1", "--spec", SPEC, "--feed", FILE]),
    ("up", "roads"): (".geojson", ["up", "1", "--roads", FILE]),
    ("join", "signing_key"): (".key", ["join", "--unit", "7", "--mavlink", "udpin:127.0.0.1:0", "--signing-key", FILE]),
    ("join", "elevation"): (".asc", ["join", "--unit", "7", "--mavlink", "udpin:127.0.0.1:0", "--elevation", FILE]),
    ("join", "replay"): (".mcap", ["join", "--unit", "7", "--replay", FILE]),
    ("join", "translation"): (".toml", ["join", "--unit", "7", "--spec", SPEC, "--translation", FILE]),
    ("join", "spec"): (".kpl", ["join", "--unit", "7", "--spec", FILE]),
    ("join", "feed"): (".jsonl", ["join", "--unit", "7", "--spec", SPEC, "--feed", FILE]),
    ("join", "roads"): (".geojson", ["join", "--unit", "7", "--spec", SPEC, "--roads", FILE]),
    ("web", "recording"): (".mcap", ["web", FILE, "--port", "0"]),
    ("check", "trace"): (".jsonl", ["check", "always altitude[uav0] > 1", "--trace", FILE]),
    ("chronicle", "file"): (".chr", ["chronicle", FILE, "--events", str(EXAMPLES / "chronicles/crossing.jsonl")]),
    ("chronicle", "events"): (".jsonl", ["chronicle", str(EXAMPLES / "chronicles/turns.chr"), "--events", FILE]),
    ("link", "file"): (".kpl", ["link", FILE, "--percepts", PERCEPTS]),
    ("link", "percepts"): (".jsonl", ["link", LINK, "--roads", ROADS, "--percepts", FILE]),
    ("link", "roads"): (".geojson", ["link", LINK, "--percepts", PERCEPTS, "--roads", FILE]),
    ("world", "file"): (".toml", ["world", FILE, "--observations", "seen.jsonl"]),
    ("world", "observations"): (".jsonl", ["world", "model.toml", "--observations", FILE]),
    ("world", "knowledge"): (".toml", ["world", "model.toml", "--observations", "seen.jsonl", "--knowledge", FILE]),
    ("match", "file"): (".json", ["match", FILE]),
    ("saliency", "supplies"): (".prob", ["saliency", "--supplies", FILE]),
    ("replay", "file"): (".mcap", ["replay", FILE]),
    ("info", "file"): (".mcap", ["info", FILE]),
    ("plot", "recording"): (".mcap", ["plot", "heli-position", "--recording", FILE]),
    ("doctor", "signing_key"): (".key", ["doctor", "--mavlink", "udpin:127.0.0.1:0", "--signing-key", FILE]),
    ("plan", "domain"): (".dom", ["plan", FILE, PROBLEM]),
    ("plan", "problem"): (".prob", ["plan", DOMAIN, FILE]),
    ("recover", "file"): (".json", ["recover", FILE]),
    ("mission start", "domain"): (".dom", ["mission", "start", FILE, PROBLEM]),
    ("mission start", "problem"): (".prob", ["mission", "start", DOMAIN, FILE]),
    ("mission start", "constraints"): (".prob", ["mission", "start", DOMAIN, PROBLEM, "--constraints", FILE]),
    ("kpl check", "file"): (".kpl", ["kpl", "check", FILE]),
    ("kpl check", "roads"): (".geojson", ["kpl", "check", SPEC, "--roads", FILE]),
    ("kpl show", "file"): (".kpl", ["kpl", "show", FILE]),
    ("kpl run", "file"): (".kpl", ["kpl", "run", FILE, "--feed", FEED]),
    ("kpl run", "feed"): (".jsonl", ["kpl", "run", SPEC, "--feed", FILE]),
    ("kpl run", "roads"): (".geojson", ["kpl", "run", SPEC, "--feed", FEED, "--roads", FILE]),
    ("kpl graph", "file"): (".kpl", ["kpl", "graph", FILE]),
    ("kpl graph", "roads"): (".geojson", ["kpl", "graph", SPEC, "--roads", FILE]),
    ("kpl verify", "file"): (".kpl", ["kpl", "verify", FILE, "--journal", "run.jsonl"]),
    ("kpl verify", "journal"): (".mcap", ["kpl", "verify", SPEC, "--journal", FILE]),
    ("ontology show", "file"): (".toml", ["ontology", "show", FILE]),
    ("ontology check", "file"): (".toml", ["ontology", "check", FILE]),
    ("roads check", "file"): (".geojson", ["roads", "check", FILE]),
    ("ls", "roster"): (".toml", ["ls", "--roster", FILE]),
    ("ls", "key"): (".key", ["ls", "--roster", "members.toml", "--key", FILE]),
    ("ls", "ontology"): (".toml", ["kpl", "run", SPEC, "--feed", FEED, "--ontology", FILE]),
    ("ls", "config"): (".toml", ["ls", "--config", FILE]),
    # of other types or with other endings
    ("ls", "federation"): (".toml", ["ls", "--federation", FILE]),
    ("up", "federation"): (".toml", ["up", "--federation", FILE]),
    ("roster show", "roster"): (".toml", ["roster", "show", "--roster", FILE]),
    ("roster add", "roster"): (".toml", ["roster", "add", "9", "--roster", FILE]),
    ("roster revoke", "roster"): (".toml", ["roster", "revoke", "9", "--roster", FILE]),
    ("join", "replay tlog"): (".tlog", ["join", "--unit", "7", "--replay", FILE]),
    ("join", "replay bin"): (".bin", ["join", "--unit", "7", "--replay", FILE]),
    ("join", "replay ulg"): (".ulg", ["join", "--unit", "7", "--replay", FILE]),
    ("join", "elevation tile"): (".hgt", ["join", "--unit", "7", "--mavlink", "udpin:127.0.0.1:0", "--elevation", FILE]),
    ("roads check", "file osm"): (".osm", ["roads", "check", FILE]),
    ("link", "percepts mot"): (".txt", ["link", LINK, "--roads", ROADS, "--percepts", FILE, "--fps", "25", "--m-per-pixel", "0.1"]),
    ("kpl verify", "journal of a run"): (".jsonl", ["kpl", "verify", SPEC, "--journal", FILE]),
    ("kpl load", "text"): (".kpl", ["kpl", "load", FILE, "--unit", "7"]),
    ("delegate", "area"): (".geojson", ["delegate", "divide-area", "--to", "7", f"area={FILE}"]),
}  # fmt: skip


def _names_files(annotation: Any) -> bool:
    return annotation is Path or any(_names_files(each) for each in get_args(annotation))


def _parameters(function: Callable[..., Any]) -> Iterator[str]:
    for each in inspect.signature(function, eval_str=True).parameters.values():
        if _names_files(each.annotation):
            yield each.name


@cache
def commands() -> dict[str, Callable[..., Any]]:
    """All of them, imported: what a command imports is no cost of the file."""
    found = {name: where.partition(":") for name, (where, _) in COMMANDS.items() if where}
    return {name: getattr(import_module(module), function) for name, (module, _, function) in found.items()}


def test_every_option_and_argument_that_names_a_file_has_a_call() -> None:
    named = {("ls", each) for each in _parameters(_common)}
    for name, function in commands().items():
        named |= {(name, each) for each in _parameters(function)}
    assert len(named) > 40
    assert named - CALLS.keys() == WRITTEN


def _sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(2**30)


def _archive(kind: str) -> Callable[[Path], None]:
    def make(path: Path) -> None:
        profile = "dyknow-federation" if "info" in kind else "dyknow"
        path.write_bytes(archives(profile)[kind.removesuffix(" info")]())

    return make


def _good(path: Path) -> bytes:
    """A file of that kind as it should be."""
    found = {
        ".kpl": EXAMPLES / "first.kpl", ".chr": EXAMPLES / "chronicles/turns.chr", ".jsonl": EXAMPLES / "first.jsonl",
        ".json": EXAMPLES / "matching/alike.json", ".toml": EXAMPLES / "federation.toml", ".dom": Path(DOMAIN), ".prob": Path(PROBLEM),
        ".geojson": EXAMPLES / "roads/town.geojson", ".mcap": EXAMPLES / "recordings/encounter.mcap", ".tlog": EXAMPLES / "flight.tlog",
    }  # fmt: skip
    return found[path.suffix].read_bytes() if path.suffix in found else b"0123456789abcdef" * 8


DIGITS = b"9" * SIZE
HOSTILE: dict[str, Callable[[Path], Any]] = {
    "another format": lambda path: path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 16),
    "empty": lambda path: path.touch(),
    "truncated": lambda path: path.write_bytes(_good(path)[: len(_good(path)) // 2 + 1]),
    "packed": lambda path: path.write_bytes(lz4.frame.compress(bytes(300_000_000))),
    "chunk of a journal": lambda path: path.write_bytes(mcap("dyknow", channel("event"), chunk("zstd", message(bytes(60_000_000))))),
    "chunk of a recording": lambda path: path.write_bytes(archives("dyknow-federation")["ratio-zstd"]()),
    "a length": lambda path: path.write_bytes(mcap("dyknow") + struct.pack("<BQ", 5, 2**62)),
    "lists": lambda path: path.write_bytes(b"[" * SIZE),
    "objects": lambda path: path.write_bytes(b'{"a":' * (SIZE // 5)),
    "deep TOML": lambda path: path.write_bytes(b"a = " + b"[" * SIZE),
    "parentheses": lambda path: path.write_bytes(b"compunit f = " + b"(" * 500_000),
    "elements": lambda path: path.write_bytes(b"<osm>" + b"<a>" * (SIZE // 3)),
    "a number of TOML": lambda path: path.write_bytes(b"a = " + DIGITS),
    "a number of JSON": lambda path: path.write_bytes(b'{"t_ms": ' + DIGITS + b"}\n"),
    "exponents": lambda path: path.write_bytes(b'{"t_ms": 1e999, "a": -1e999}\n' * 1000),
    "zeros": lambda path: path.write_bytes(bytes(SIZE)),
    "no text": lambda path: path.write_bytes(b"\xff\xfe" * 5000),
    "half a character": lambda path: path.write_bytes(b"# \xc3\n\xa9\n"),
    "a line": lambda path: path.write_bytes(b"a" * 3 * SIZE),
    "many lines": lambda path: path.write_bytes(b"x\n" * (SIZE // 2)),
    "a gigabyte": _sparse,
    "a directory": lambda path: path.mkdir(),
    "a pipe": os.mkfifo,
    "a device": lambda path: path.symlink_to("/dev/zero"),
    "a circle": lambda path: path.symlink_to(path.name),
    "nothing": lambda path: None,
}  # fmt: skip
HARMLESS = {"empty", "many lines", "truncated", "half a character", "zeros", "a line", "a length"}
"""What can be right in some format: an empty list of samples, half a text, a key of letters."""
SERVED = {("web", "recording", "chunk of a recording"), ("web", "recording", "a length")}
"""What is shown as far as it is read, with a note on what is not. Texts of missions go to the platforms, which refuse them."""


class Ran(NamedTuple):
    """What a command did: its exit code, None where it went on to the federation; and its cost."""

    code: int | None
    said: str
    cpu_s: float
    resident_mb: float


class _WentOn(BaseException):
    """The file was read, and the command begins to do what it is for."""


def _run(words: list[str], folder: Path, told: Connection) -> None:
    """In a process of its own: the command, up to where it would start or ask others."""
    resource.setrlimit(resource.RLIMIT_AS, (8 << 30, 8 << 30))
    os.chdir(folder)
    os.environ.update(XDG_RUNTIME_DIR=str(folder), COLUMNS="400", TERM="dumb")
    err = os.open(folder.parent / "said", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(err, 1)
    os.dup2(err, 2)
    sys.stdout, sys.stderr = os.fdopen(1, "w", closefd=False), os.fdopen(2, "w", closefd=False)

    def go_on(*_: Any, **__: Any) -> None:
        raise _WentOn

    from dyknow.console.commands.outward import web
    from dyknow.console.processes import supervision
    from dyknow.runtime import client

    supervision.Fleet.__init__ = client.Client.__enter__ = go_on  # type: ignore[method-assign,assignment]
    web._serve = go_on  # type: ignore[assignment]
    began_s, code = time.process_time(), None
    sys.addaudithook(refuse_unpickling)
    try:
        app([*words], prog_name="dyknow")
    except SystemExit as end:
        code = end.code
    except (_WentOn, SessionFailed):
        code = None
    except BaseException as wrong:  # noqa: BLE001  (told to the test)
        sys.stderr.write(f"Traceback of {wrong!r}")
    sys.stdout.flush()
    sys.stderr.flush()
    usage = resource.getrusage(resource.RUSAGE_SELF)
    told.send((code, time.process_time() - began_s, usage.ru_maxrss / 1024))


def run(words: list[str], folder: Path) -> Ran:
    commands()
    mine, its = FORK.Pipe()
    process = FORK.Process(target=_run, args=(words, folder, its))
    process.start()
    try:
        assert mine.poll(12 * MOST_S), f"it takes minutes: {words}"
        code, cpu_s, resident_mb = mine.recv()
    finally:
        process.kill()
        process.join()
    return Ran(code, (folder.parent / "said").read_text("utf-8", "replace"), cpu_s, resident_mb)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "work").mkdir()
    (tmp_path / "said").touch()
    (tmp_path / "work" / "model.toml").write_text(MODEL)
    (tmp_path / "work" / "seen.jsonl").write_text("")
    (tmp_path / "work" / "run.jsonl").write_text("{}")
    cc = RosterMember("cc", Signer(bytes(32), "").public_key, "command-centre")
    (tmp_path / "work" / "members.toml").write_text(str(Roster({"cc": cc}, "default")))
    return tmp_path / "work"


@cache
def bare_mb(command: tuple[str, str]) -> dict[str, float]:
    """Resident memory of the command that finds no file, once it is measured."""
    return {}


def _cases() -> list[Any]:
    """Every call with every hostile file; in short each hostile file with one call."""
    kinds = [each for each in HOSTILE if each != "nothing"]
    draw = Random(7)
    cases = [(call, kind) for call in CALLS for kind in kinds]
    if not FULL:
        cases = [(draw.choice(list(CALLS)), kind) for kind in kinds]
    return [pytest.param(call, kind, id=f"{' '.join(call)}: {kind}") for call, kind in cases]


@pytest.mark.parametrize(("command", "kind"), _cases())
def test_a_hostile_file_ends_the_command_in_a_sentence_at_a_bounded_cost(
    command: tuple[str, str], kind: str, folder: Path
) -> None:
    ending, call = CALLS[command]
    path = folder / f"hostile{ending}"
    words = [each.replace(FILE, path.name) for each in call]
    if not bare_mb(command):
        bare_mb(command)["bare"] = run(words, folder).resident_mb
    HOSTILE[kind](path)
    before = sorted(each.relative_to(folder.parent) for each in folder.parent.rglob("*"))
    ran = run(words, folder)
    figures = {"call": " ".join(command), "file": kind, "code": ran.code, "s": round(ran.cpu_s, 3)}
    grown_mb = ran.resident_mb - bare_mb(command)["bare"]
    print(json.dumps(figures | {"MB": round(grown_mb, 1), "said": ran.said[:160]}))
    assert "Traceback" not in ran.said, ran.said[-600:]
    assert ran.cpu_s < MOST_S
    assert grown_mb < MOST_MB
    assert len(ran.said) < MOST_CHARACTERS
    after = {each.relative_to(folder.parent) for each in folder.parent.rglob("*")}
    assert after - {*before} <= {Path("work/plot.svg")}, "nothing is written"
    if kind in HARMLESS or (*command, kind) in SERVED or (command[0] == "mission start" and ran.code is None):
        assert ran.code in {None, 0, 1, 2}
        return
    assert ran.code in {1, 2}, ran.said[:600]
    first = ran.said.split("\n")[0]
    assert path.name in first, ran.said[:600]
    assert first.startswith(("dyknow ", "left out: ", "error ")), first
    assert "\x1b" not in ran.said
    assert len(first) < 600


OUTSIDE = ["../../evil", "/tmp/evil-of-dyknow", "..", "a/../../evil", "evil\0", "~/evil", "work/evil", "*"]
"""Names of what a file holds, as if they were places."""


def _recording(path: Path, name: str) -> None:
    about = {"federation": name, "clock_epoch_us": "0", "clock_speed": "1.0", "recorder": name, "since_us": "0"}
    with RecordingFile(path, about, lambda: 0) as file:
        for at_us in range(0, 2_000_000, 100_000):
            said = {"unit": name, "label": name, "valid_us": at_us, "available_us": at_us, "value": {"value": 1.0}}
            file.add(f"/{name}/{name}", SAMPLE, said, at_us, at_us)
    attached = b"".join(struct.pack("<I", len(each)) + each for each in (name.encode(), b"text/plain"))
    record = struct.pack("<QQ", 0, 0) + attached + struct.pack("<QI", 0, 0)
    whole = path.read_bytes()
    first = whole.index(b"\x0c")  # before the metadata
    path.write_bytes(whole[:first] + struct.pack("<BQ", 9, len(record)) + record + whole[first:])


SHOWING = ["info", "mended", "replay", "plot", "web"]


@pytest.mark.parametrize(
    ("call", "name"),
    [*product(SHOWING, OUTSIDE)] if FULL else [(SHOWING[at % len(SHOWING)], name) for at, name in enumerate(OUTSIDE)],
)
def test_names_in_a_recording_are_no_places(call: str, name: str, folder: Path) -> None:
    _recording(folder / "a.mcap", name)
    words = {
        "info": ["info", "a.mcap"], "mended": ["info", "a.mcap", "--mended", "new.mcap"], "replay": ["replay", "a.mcap"],
        "plot": ["plot", "heli-position", "--recording", "a.mcap"], "web": ["web", "a.mcap", "--port", "0"],
    }[call]  # fmt: skip
    before = {*folder.parent.rglob("*")}
    ran = run(words, folder)
    new = {*folder.parent.rglob("*")} - before
    assert {each.name for each in new} <= ({"new.mcap"} if call == "mended" else set())
    assert not Path("/tmp/evil-of-dyknow").exists()
    assert "Traceback" not in ran.said
    assert ran.code in ({0, None} if call in {"info", "mended", "web"} else {1, 2}), ran.said
    assert "\0" not in ran.said
