"""An instance is told at the earliest clock at which every continuation of the events gives it: not later, not earlier."""

import os
from itertools import chain, combinations, product

from dyknow.model.errors import ChronicleError
from dyknow.reasoning.chronicles import ChronicleVariable
from tests.reasoning.chronicles.definition import Happening, Meaning, in_order
from tests.reasoning.chronicles.random_chronicles import OBJECTS, VALUES, Maker
from tests.reasoning.chronicles.test_definition import compare, told

COUNT = 5_000 if os.environ.get("DYKNOW_FULL") else 200
HORIZON_MS = 12


def runs():
    """(file, events in order, instances) of random chronicles."""
    for seed in range(COUNT):
        maker = Maker(seed)
        file, happenings = maker.file(), in_order(maker.happenings())
        try:
            yield file, happenings, told(file, happenings)
        except ChronicleError:
            continue


def test_whatever_comes_later_what_was_told_before_stays() -> None:
    checked = 0
    for file, happenings, found in runs():
        for cut_ms in {one.at_ms for one in happenings}:
            known = [one for one in happenings if one.at_ms < cut_ms]
            before = [one for one in told(file, known) if one.recognised_ms < cut_ms]
            assert compare(before) == compare([one for one in found if one.recognised_ms < cut_ms])
            checked += len(before)
    assert checked > COUNT / 4


def gives(meaning, happenings, instance) -> bool:
    """Whether the events, all of them known, make this an instance before those that could come are over."""
    symbols, fixed = dict(instance.bindings), dict(instance.instants)
    happenings, until_ms = set(happenings), instance.recognised_ms - 1 + HORIZON_MS
    matching = [sorted(one.at_ms for one in happenings if meaning.is_of(one, n, symbols)) for n in meaning.needs]
    if any(len(times) < need.least for times, need in zip(matching, meaning.needs, strict=True)):
        return False
    settled = (
        meaning._settled(times, matching, None)
        for times in meaning._assignments(matching)
        if fixed.items() <= times.items()
    )
    return any(clock_ms is not None and clock_ms < until_ms for clock_ms in settled)


def everything(meaning, need, instance, from_ms):
    """All events of the type of a predicate that could come from then on."""
    symbols, arity = dict(instance.bindings), len(need.parameters) - 2 * need.is_change
    changes = list(product((*OBJECTS, *VALUES), repeat=2)) if need.is_change else [None]
    made = product(range(from_ms, from_ms + HORIZON_MS), product(OBJECTS, repeat=arity), changes)
    some = (Happening(at_ms, need.name, arguments, change) for at_ms, arguments, change in made)
    return [one for one in some if meaning.is_of(one, need, symbols)]


def has_room(meaning) -> bool:
    """Whether enough different events fit into a millisecond to pass every upper limit; one that only events of one
    kind could pass is taken as open until its interval has passed, all the same.
    """
    wild = [
        any(isinstance(one, ChronicleVariable) and str(one) not in meaning.bound for one in need.parameters)
        for need in meaning.needs
    ]
    return not meaning.file.attributes and all(
        need.most in {None, 0} or (need.most < len(OBJECTS) and is_wild)
        for need, is_wild in zip(meaning.needs, wild, strict=True)
    )


def test_before_it_is_told_something_could_still_undo_it() -> None:
    """One clock earlier either an event is missing, or there are events that, if they come, undo it: all events of the
    types of some of its predicates.
    """
    checked = 0
    for file, happenings, found in runs():
        meaning = Meaning("outer", file)
        if len(file.chronicles) > 1 or not meaning.fixed or not has_room(meaning):
            continue
        for instance in found[:3]:
            clock_ms = instance.recognised_ms
            if clock_ms < 0 or any("~" in name for name, _ in instance.instants):
                continue
            known = [one for one in happenings if one.at_ms < clock_ms]
            floods = [everything(meaning, need, instance, clock_ms - 1) for need in meaning.needs]
            some = chain.from_iterable(combinations(floods, count) for count in range(len(floods) + 1))
            assert not all(gives(meaning, known + list(chain(*more)), instance) for more in some)
            checked += 1
    assert checked > COUNT / 25
