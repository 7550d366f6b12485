"""Files from anyone: small ones that unpack to much, are deep, or name what lies elsewhere, for every reader of files."""

import json
import multiprocessing
import os
import resource
import struct
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import lz4.frame
import msgpack
import pytest
import zstandard

from dyknow.anchoring.belief.files.models import read_world_model
from dyknow.anchoring.roads.files.formats import survey_any
from dyknow.documents.documents import json_document
from dyknow.federation.security.trust import Roster
from dyknow.federation.sharing.ontology import default_ontology
from dyknow.kpl import parse_specification
from dyknow.model.errors import DyknowError, SourceText, WrongCall
from dyknow.planning.domains.model import Declarations
from dyknow.planning.domains.packing import unpacked
from dyknow.planning.domains.texts import parse_domain
from dyknow.proxies.files.named_files import beside
from dyknow.proxies.recordings.formats import open_recording
from dyknow.proxies.recordings.journal_file import ABOUT, read_about, read_journal
from dyknow.proxies.recordings.mcap_records import MAGIC
from dyknow.proxies.recordings.sample_file import read_feed
from dyknow.reasoning.monitoring.profiles import parse_profiles
from dyknow.runtime.configuration.areas import corners_of
from dyknow.runtime.configuration.ontologies import read_ontology
from dyknow.runtime.configuration.road_files import read_bytes
from dyknow.runtime.configuration.settings import FederationFile
from dyknow.runtime.configuration.toml import read_model
from dyknow.runtime.recordings.recorded import FederationRecording
from dyknow.runtime.recordings.recording_file import PROFILE

FORK = multiprocessing.get_context("fork")
MOST_S, MOST_MB = 5.0, 100
SIZE = 1_000_000 if os.environ.get("DYKNOW_FULL") else 100_000
"""Bytes of a text."""
Bomb = Callable[[], bytes]


def record(kind: int, body: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(body)) + body


def text(said: str) -> bytes:
    return struct.pack("<I", len(said)) + said.encode()


def chunk(compression: str, data: bytes) -> bytes:
    packed = {"lz4": lz4.frame.compress, "zstd": zstandard.ZstdCompressor().compress, "": bytes}[compression](data)
    return record(
        6, struct.pack("<QQQI", 0, 0, len(data), 0) + text(compression) + struct.pack("<Q", len(packed)) + packed
    )


def mcap(profile: str, *records: bytes) -> bytes:
    about = text(ABOUT if profile == "dyknow" else "federation") + text("")
    return MAGIC + record(1, text(profile) + text("")) + record(12, about) + b"".join(records)


def channel(topic: str) -> bytes:
    return record(4, struct.pack("<HH", 1, 0) + text(topic) + text("msgpack") + text(""))


def message(data: bytes) -> bytes:
    return record(5, struct.pack("<HIQQ", 1, 0, 0, 0) + data)


def nested(levels: int) -> bytes:
    """Extensions inside one another, as a journal has its tuples."""
    data = b"\x90"
    for _ in range(levels):
        data = msgpack.packb(msgpack.ExtType(2, data))
    return data


def archives(profile: str) -> dict[str, Bomb]:
    return {
        "ratio-lz4": lambda: mcap(profile, chunk("lz4", bytes(300_000_000))),
        "ratio-zstd": lambda: mcap(profile, chunk("zstd", bytes(300_000_000))),
        "many-chunks": lambda: mcap(profile, channel("time"), chunk("zstd", message(b"") * 80_000) * 400),
        "long-record": lambda: mcap(profile) + struct.pack("<BQ", 6, 2**62),
        "metadata": lambda: mcap(profile, record(12, text("x") + struct.pack("<I", 240_000) + (text("") * 2) * 30_000)),
        "channels": lambda: mcap(profile, chunk("zstd", channel("x") * 60_000)),
        "empty": bytes,
        "made": lambda: MAGIC,
    }


def ulog(*messages: tuple[str, bytes]) -> bytes:
    said = (struct.pack("<HB", len(body), ord(kind)) + body for kind, body in messages)
    return b"ULog\x01\x12\x35\x01" + bytes(8) + b"".join(said)


TOPIC = b"\0\1\0vehicle_gps_position"
GPS = b"vehicle_gps_position:"
ULOGS: dict[str, Bomb] = {
    "fan": lambda: ulog(
        *(("F", b"t%d:" % d + b"t%d a;" % (d + 1) * 3000) for d in range(8)), ("F", GPS + b"t0 a;"), ("A", TOPIC)
    ),
    "fields": lambda: ulog(("F", GPS + b"double[9999] a;" * 2000), ("A", TOPIC)),
    "padding": lambda: ulog(("F", GPS + b"char[9999] _padding0;" * 2000), ("A", TOPIC), *[("D", b"\1\0")] * 20_000),
    "circle": lambda: ulog(("F", GPS + b"vehicle_gps_position a;" * 2000), ("A", TOPIC)),
    "definitions": lambda: ulog(*(("F", b"t%d:" % d) for d in range(20_000))),
    "digits": lambda: ulog(("F", GPS + b"char[" + b"9" * 60_000 + b"] a;"), ("A", TOPIC)),
    "noise": lambda: ulog() + b"\xff" * SIZE,
}
FLASH: dict[str, Bomb] = {
    "formats": lambda: b"".join(
        b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", i % 250 + 1, 255, b"ABCD", b"Q" * 16, b"a," * 32)
        for i in range(SIZE // 89)
    ),
    "marks": lambda: b"\xa3\x95\x80" + bytes(86) + b"\xa3\x95\xff" * (SIZE // 3),
    "noise": lambda: b"\xa3\x95" + bytes(SIZE),
}
TLOGS: dict[str, Bomb] = {
    "noise": lambda: bytes(SIZE),
    "begins": lambda: b"\xfd\xff\0" * (SIZE // 3),
    "stamps": lambda: (struct.pack(">Q", 1_500_000_000_000_000) + b"\xfe\xff") * (SIZE // 10),
}
EVENTS: dict[str, Bomb] = {
    "depth": lambda: nested(3000),
    "lists": lambda: b"\x91" * 60_000,
    "claimed": lambda: b"\xdd\x00\x0f\x00\x00" * 400 + bytes(1_000_000),
    "kind": lambda: msgpack.packb(msgpack.ExtType(1, msgpack.packb([["x"]]))),
    "no-list": lambda: msgpack.packb(msgpack.ExtType(1, msgpack.packb(7))),
}
TREES: dict[str, Bomb] = {
    "depth": lambda: b"[" * SIZE,
    "objects": lambda: b'{"a":' * (SIZE // 5),
    "digits": lambda: b'{"a": ' + b"9" * SIZE + b"}",
    "keys": lambda: b"{" + b",".join(b'"k%d": 1' % k for k in range(SIZE // 12)) + b"}",
    "lists": lambda: b'{"type": "FeatureCollection", "features": [' + b"[]," * (SIZE // 3) + b"[]]}",
    "noise": lambda: b"\xff" * SIZE,
}
TABLES: dict[str, Bomb] = {
    "dots": lambda: b"a." * (SIZE // 2) + b"a = 1",
    "header": lambda: b"[" + b"a." * (SIZE // 2) + b"a]",
    "quoted": lambda: b"'a' . " * (SIZE // 6) + b"a = 1",
    "depth": lambda: b"a = " + b"[" * SIZE,
    "inline": lambda: b"a = " + b"{a=" * (SIZE // 3),
    "keys": lambda: b"".join(b"k%d = 1\n" % k for k in range(SIZE // 12)),
    "tables": lambda: b"".join(b"[t%d]\nx = 1\n" % k for k in range(SIZE // 16)),
    "digits": lambda: b"a = " + b"9" * SIZE,
    "hexadecimal": lambda: b"a = 0x" + b"f" * SIZE,
    "underscores": lambda: b"a = 1" + b"_1" * (SIZE // 2),
    "fraction": lambda: b"a = 1." + b"1" * SIZE,
    "exponent": lambda: b"a = 1e" + b"1" * SIZE,
    "nearly": lambda: (b"9" * 4299 + b" " + b"0b" * 2149 + b" ") * (SIZE // 8599),
    "parts": lambda: (b"'a'." * 31 + b" a\n") * (SIZE // 127),
    "quotes": lambda: b'"\\' * (SIZE // 2) + b"\n" + b"9" * 4300,
    "lines": lambda: b'a = """' + b'\\"' * (SIZE // 2) + b"\n" + b"9" * 4300,
    "word": lambda: b"a" * SIZE,
    "noise": lambda: b"\xff" * SIZE,
}
ROADS: dict[str, Bomb] = {
    "entities": lambda: b'<!DOCTYPE a [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><osm>&b;</osm>',
    "depth": lambda: b"<osm>" + b"<a>" * (SIZE // 3),
    "attributes": lambda: b"<osm><node " + b" ".join(b'a%d="1"' % k for k in range(SIZE // 10)) + b"/></osm>",
    "children": lambda: b"<osm>" + b"<way><nd/></way>" * (SIZE // 16) + b"</osm>",
    "edges": lambda: b"<net>" + b"<edge/>" * (SIZE // 7) + b"</net>",
}
SPECS: dict[str, Bomb] = {
    "depth": lambda: b"compunit f = " + b"(" * 60_000,
    "traversal": lambda: b'import "../../../../../../etc/passwd"\n' * 20,
    "line": lambda: b"a" * 60_000,
}


def _mcap_events(made: Bomb) -> bytes:
    return mcap("dyknow", channel("event"), message(made()))


def _journal(path: Path) -> object:
    return read_about(path), sum(1 for _ in read_journal(path))


def _decoded(path: Path) -> str:
    try:
        return path.read_bytes().decode("utf-8")
    except UnicodeDecodeError as wrong:
        raise WrongCall(f"{path}: no UTF-8 text ({wrong.reason}); write text") from None


def _packed(path: Path) -> object:
    try:
        return unpacked(path.read_text("latin-1"), Declarations)
    except ValueError as wrong:
        raise WrongCall(f"{path}: {wrong}; read it again") from None


READERS: dict[str, tuple[str, dict[str, Bomb], Callable[[Path], object]]] = {
    "journal": (".mcap", archives("dyknow"), _journal),
    "events": (".mcap", {name: partial(_mcap_events, made) for name, made in EVENTS.items()}, _journal),
    "replayed journal": (".mcap", archives("dyknow"), open_recording),
    "recording": (".mcap", archives(PROFILE), lambda path: sum(1 for _ in FederationRecording(path).messages())),
    "ulg": (".ulg", ULOGS, open_recording),
    "bin": (".bin", FLASH, open_recording),
    "tlog": (".tlog", TLOGS, open_recording),
    "area": (".geojson", TREES, lambda path: corners_of(str(path))),
    "roads": (".geojson", TREES | ROADS, lambda path: survey_any(read_bytes(path, "--roads")).required(str(path))),
    "document": (".json", TREES, lambda path: json_document(path.read_bytes(), str(path), "{}")),
    "feed": (".jsonl", TREES, lambda path: read_feed(_decoded(path).splitlines(), str(path))),
    "settings": (".toml", TABLES, lambda path: read_model(path, FederationFile)),
    "roster": (".toml", TABLES, lambda path: Roster.parse(_decoded(path))),
    "profiles": (".toml", TABLES, lambda path: parse_profiles(_decoded(path), str(path))),
    "world model": (".toml", TABLES, lambda path: read_world_model(_decoded(path), str(path))),
    "labels": (".toml", TABLES, lambda path: default_ontology().extended(read_ontology(path), str(path))),
    "specification": (".kpl", SPECS, lambda path: parse_specification(SourceText(_decoded(path)), beside(path))),
    "domain": (".dom", SPECS, lambda path: parse_domain(_decoded(path))),
    "packed": (".json", TREES, _packed),
}


def _cases() -> Iterator[Any]:
    for reader, (_, bombs, _) in READERS.items():
        yield from (pytest.param(reader, bomb, id=f"{reader}-{bomb}") for bomb in bombs)


def refuse_unpickling(event: str, _arguments: tuple[Any, ...]) -> None:
    """An audit hook for the rest of a process: nothing that reads a file may have bytes name what is called."""
    if event == "pickle.find_class":
        raise AssertionError("a reader unpickles")


def _measured(read: Callable[[Path], object], path: Path, said: Connection) -> None:
    sys.addaudithook(refuse_unpickling)
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began_s = time.process_time()
    try:
        read(path)
        outcome = ""
    except DyknowError as wrong:
        outcome = f"refused: {wrong}"
    except BaseException as wrong:  # noqa: BLE001  (told to the test)
        outcome = f"{type(wrong).__name__}: {wrong}"
    grown_mb = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb) / 1024
    said.send((outcome[:2000], time.process_time() - began_s, grown_mb))


@pytest.mark.parametrize(("reader", "bomb"), list(_cases()))
def test_a_small_file_costs_little_and_is_refused_with_place_cause_and_remedy(
    reader: str, bomb: str, tmp_path: Path
) -> None:
    ending, bombs, read = READERS[reader]
    path = tmp_path / "in" / f"bomb{ending}"
    path.parent.mkdir()
    path.write_bytes(bombs[bomb]())
    mine, its = FORK.Pipe()
    process = FORK.Process(target=_measured, args=(read, path, its))
    process.start()
    try:
        assert mine.poll(12 * MOST_S), "it takes minutes"
        outcome, took_s, grown_mb = mine.recv()
    finally:
        process.kill()
        process.join()
    assert outcome == "" or outcome.startswith("refused: "), outcome[:300]
    assert took_s < MOST_S
    assert grown_mb < MOST_MB
    assert [one.name for one in tmp_path.rglob("*") if one.is_file()] == [path.name], "nothing is written"
    print(
        json.dumps(
            {"reader": reader, "bomb": bomb, "s": round(took_s, 3), "MB": round(grown_mb, 1), "said": outcome[:150]}
        )
    )


@pytest.mark.parametrize("name", ["folder", "/dev/zero", "a\0b", "missing"])
def test_a_file_names_only_files_of_text(name: str, tmp_path: Path) -> None:
    (tmp_path / "in" / "folder").mkdir(parents=True)
    (tmp_path / "roads.geojson").write_text("roads")
    (tmp_path / "in" / "folder" / "a.kpl").write_text("mine")
    read = beside(tmp_path / "in" / "a.kpl")
    assert read("folder/a.kpl") == "mine"
    assert read("../roads.geojson") == "roads"
    with pytest.raises(OSError, match=r"no file|none of a file|No such file"):
        read(name)
