"""A journal of an earlier version of the code replays to the effects that it had then.

`encounter.mcap` is the journal of platform 0 in a simulated world of 26 s: two simulated aircraft fly towards each other,
a command centre delegates `monitor-proximity` to platform 0, which runs a specification with a fed source, an import and
a monitor; the two agree that 0 gives way, it does so, resumes its route, and leaves. `encounter.jsonl` has
what the code that wrote the journal did with it, one effect a line: [kind, microseconds since the start, content ...].

A difference means that journals which people keep no longer replay. Change the code, not these two files; where the
behaviour has changed on purpose, `python -m tests.runtime.journal.recording` makes both again, and the commit says why.
"""

import json
from collections import defaultdict
from pathlib import Path

import pytest

from tests.runtime.journal.effects import replayed_effects

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def recorded():
    effects = defaultdict(list)
    for line in (HERE / "encounter.jsonl").read_text("utf-8").splitlines():
        kind, *effect = json.loads(line)
        effects[kind].append(effect)
    return effects


@pytest.fixture(scope="module")
def replayed():
    return replayed_effects(HERE / "encounter.mcap")


def test_the_journal_holds_what_is_worth_comparing(recorded):
    assert len(recorded["samples"]) > 400
    assert len(recorded["acts"]) >= 15
    assert [order for _, _, order, *_ in recorded["commands"]] == ["goto"] * 3 + ["hold"], (
        "its route, the manoeuvre, its route, the end of it"
    )
    assert [record["monitor"] for _, record in recorded["told"] if record["event"] == "alarm-opened"] == ["apart"]
    assert sum("(avoid units: " in (effect[4] or "") for effect in recorded["acts"]) >= 1


@pytest.mark.parametrize(
    "kind", ["samples", "told", "acts", "commands", "heartbeats", "descriptions", "receipts", "questions", "answers"]
)
def test_it_replays_to_the_same_effects(recorded, replayed, kind):
    assert replayed[kind] == recorded[kind]


def test_no_kind_of_effect_is_new(recorded, replayed):
    assert replayed.keys() == recorded.keys()
