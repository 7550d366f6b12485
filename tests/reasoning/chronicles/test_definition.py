"""The engine recognises what the definitions say: the same instances, each at the same clock, and nothing else."""

import os
from collections import Counter

import pytest

from dyknow.model.errors import ChronicleError
from dyknow.reasoning.chronicles import MINUS_INFINITY, Recogniser
from tests.reasoning.chronicles.definition import Found, Meaning, recognised
from tests.reasoning.chronicles.random_chronicles import Maker

UNTIL_MS = 40


def told(file, happenings, max_age_ms=None):
    """What the engine tells, as the clock goes."""
    recogniser = Recogniser.of(file, max_age_ms=max_age_ms)
    found = []
    for one in happenings:
        if one.change is None:
            found += recogniser.on_message(one.at_ms, one.name, one.arguments)
        else:
            found += recogniser.on_change(one.at_ms, one.name, one.arguments, *one.change)
    found += recogniser.on_time(UNTIL_MS)
    assert not recogniser.incomplete
    return [
        Found(
            one.chronicle, tuple(sorted(one.bindings.items())), tuple(sorted(one.instants.items())), one.recognised_ms
        )
        for one in found
    ]


def compare(found):
    """Instances as they are compared: what an instant of its own (`t + [0, 5]`) is called does not matter, nor how long
    before or after -oo something is.
    """

    def shown(name, at_ms):
        return name.partition("~")[0], MINUS_INFINITY if at_ms < MINUS_INFINITY // 2 else at_ms

    return Counter(one._replace(instants=tuple(sorted(shown(*each) for each in one.instants))) for one in found)


def compared(seed):
    """How many instances there were; None for a chronicle that is refused."""
    maker = Maker(seed)
    file, happenings, max_age_ms = maker.file(), maker.happenings(), maker.max_age_ms()
    try:
        engine = told(file, happenings, max_age_ms)
    except ChronicleError as refused:
        if "contradict" in str(refused) and "max_age" not in str(refused):
            assert not all(Meaning(name, file).is_possible for name in file.chronicles)
        return None
    assert all(Meaning(name, file).is_possible for name in file.chronicles)
    assert [one.recognised_ms for one in engine] == sorted(one.recognised_ms for one in engine)
    assert compare(engine) == compare(recognised(file, happenings, UNTIL_MS, max_age_ms))
    return len(engine)


@pytest.mark.timeout(3_000)
def test_the_engine_recognises_what_the_definitions_say():
    wanted = 5_000 if os.environ.get("DYKNOW_FULL") else 110
    counts, seed = [], 0
    while len(counts) < wanted:
        found = compared(seed)
        seed += 1
        if found is not None:
            counts.append(found)
    assert seed < 3 * wanted
    assert sum(count > 0 for count in counts) > wanted / 5
