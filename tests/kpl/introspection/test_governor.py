"""Process refinement (thesis 10.7): when there is too much to do the least important streams suffer, and only so long."""

from collections import deque
from itertools import pairwise

import pytest

from dyknow import Network, Sample, prototypes_in, value_unit
from dyknow.kpl import Hooks, Instance, parse_specification
from dyknow.kpl.introspection.governor import Governor
from dyknow.model.errors import TextErrors

SPECIFICATION = """
source pos gps
strmgen pos[self] = gps
strmgen heavy[self] = Heavy(pos[self] with sample every 20, importance 1)
strmgen vital[self] = Vital(pos[self] with sample every 20, importance 5)
stream heavy_out = heavy[self]
stream vital_out = vital[self]
stream refinements_out = refinements
"""
PERIOD_US = 20_000
S = 1_000_000


class World:
    """One thread with a clock of its own: samples wait in a queue while units take their time."""

    def __init__(self, seconds, ends_s, *, governed=True, heavy_us=24_000, text=SPECIFICATION):
        self.now_us = self.waited_us = 0
        self.costs_us = {"Heavy": heavy_us, "Vital": 1_000, "Rough": 2_000}
        self.network, self.out = Network(), []
        self.instance = Instance(
            self.network,
            prototypes=prototypes_in([self._unit("Heavy", cheaper="Rough"), self._unit("Vital"), self._unit("Rough")]),
            hooks=Hooks(lambda name, sample: self.out.append((self.now_us, name, sample))),
        )
        self.governor = Governor(self.instance, lambda: self.waited_us, 0) if governed else None
        if not governed:
            text = "".join(line for line in text.splitlines(keepends=True) if "refinements" not in line)
        self.instance.add(parse_specification(text), 0, text)
        self._run(deque(range(0, round(seconds * S), PERIOD_US)), round(ends_s * S))

    def _unit(self, name, cheaper=""):
        @value_unit("pos", "pos", name=name, cheaper=cheaper)
        def unit(value):
            self.now_us += self.costs_us[name]
            return value

        return unit

    def _run(self, queue, ends_us):
        timed = [self.network, *([self.governor] if self.governor else [])]
        while queue:
            if self.now_us >= ends_us:
                self.costs_us = dict.fromkeys(self.costs_us, 250)
            dues_us = [due_us for each in timed if (due_us := each.deadline_us) is not None]
            due_us = min([queue[0], *dues_us])
            self.waited_us += max(0, due_us - self.now_us)
            self.now_us = max(self.now_us, due_us)
            if queue[0] <= self.now_us:
                self.instance.push("gps", Sample(self.now_us, queue.popleft(), 1.0))
            for each in timed:
                if each.deadline_us is not None and each.deadline_us <= self.now_us:
                    each.on_time(self.now_us)

    def delays_ms(self, name, from_s, to_s):
        return [
            (now_us - sample.valid_us) / 1000
            for now_us, stream, sample in self.out
            if stream == name and from_s * S <= sample.valid_us < to_s * S
        ]

    def steps(self):
        return [(now_us / S, *sample.value) for now_us, name, sample in self.out if name == "refinements_out"]

    def periods_ms(self, name, from_s, to_s):
        valid = [s.valid_us for _, stream, s in self.out if stream == name and from_s * S <= s.valid_us < to_s * S]
        return {(b - a) / 1000 for a, b in pairwise(valid)}


def test_without_a_governor_the_delay_grows_and_grows():
    world = World(6, 100, governed=False)
    assert max(world.delays_ms("heavy_out", 0, 1)) < 400
    assert min(world.delays_ms("heavy_out", 5, 6)) > 1_200


def test_the_source_goes_to_25_hz_within_2_s_and_delays_stay_below_100_ms_until_the_load_ends():
    world = World(25, 12)
    first, *more = world.steps()
    assert first[0] < 2.0
    assert first[1:3] == ("pos[0] for heavy[0]", "sample every 40ms")
    assert world.periods_ms("heavy_out", 2, 12) == {40.0}
    assert max(world.delays_ms("heavy_out", 5, 12)) < 100
    assert max(world.delays_ms("vital_out", 5, 12)) < 100
    assert world.periods_ms("vital_out", 0, 25) == {20.0}, "what is more important does not suffer"
    assert [step[1:3] for step in more] == [("pos[0] for heavy[0]", "sample every 20ms")], "and nothing swings"
    assert 12.0 < more[0][0] < 17.0
    assert world.periods_ms("heavy_out", 17, 25) == {20.0}


@pytest.mark.parametrize("heavy_us", [21_000, 30_000, 60_000, 150_000])
def test_however_heavy_the_load_it_is_met_in_a_few_steps_and_all_of_them_are_taken_back(heavy_us):
    world = World(40, 20, heavy_us=heavy_us)
    assert max(world.delays_ms("vital_out", 10, 20)) < 100 + heavy_us / 1000
    times = [step[0] for step in world.steps()]
    assert not [time for time in times if 10 < time < 20], "it settles"
    assert world.governor.steps == []
    assert world.periods_ms("heavy_out", 35, 40) == {20.0}
    assert world.instance.network.process(next(iter(world.instance.network.labels()))) is None


def test_a_stream_without_a_period_is_made_by_a_cheaper_unit_for_a_while():
    text = SPECIFICATION.replace("sample every 20, importance 1", "importance 1")
    world = World(25, 12, text=text)
    assert world.steps()[0][1:3] == ("heavy[0]", "made by Rough")
    assert world.steps()[-1][1:3] == ("heavy[0]", "made by Heavy")
    assert max(world.delays_ms("vital_out", 5, 12)) < 100


class Full(World):
    """Overloaded for good, with a choice of what becomes of more."""

    def __init__(self, admission):
        super().__init__(3, 100, heavy_us=24_000)
        self.instance.compiler.admission = admission
        self.governor.load = 0.97

    def add(self, text):
        self.instance.add(parse_specification(text), self.now_us, text)


def test_what_there_is_no_time_for_is_refused_in_words():
    world = Full("refuse")
    before = world.instance.specification
    with pytest.raises(TextErrors, match=r"1:1: there is no time for more: 97% of it is spent"):
        world.add("stream more = pos[self] with sample every 20")
    assert world.instance.specification == before
    world.add("define LIMIT = 5")


def test_or_it_is_admitted_at_a_longer_period_until_there_is_room():
    world = Full("longer")
    world.add("stream more = pos[self] with sample every 20")
    assert world.instance.streams["more"].adapter.policy.sample_us == 40_000
    assert world.steps()[-1][1:3] == ("pos[0] for more", "sample every 40ms")
    assert str(world.instance.streams["more"].policy) == "sample every 20", "it is printed back as it was declared"


def test_a_period_that_nobody_keeps_is_refused_or_lengthened():
    refusing, lengthening = Full("refuse"), Full("longer")
    text = "stream more = pos[self] with sample every 1us"
    with pytest.raises(TextErrors, match="a sample every 1us cannot be served"):
        refusing.add(text)
    lengthening.governor.load = 0.1
    lengthening.add(text)
    assert lengthening.instance.streams["more"].adapter.policy.sample_us == 1_000


@pytest.mark.parametrize(("important", "other"), [("heavy", "vital"), ("vital", "heavy")])
def test_what_an_important_stream_is_made_of_is_as_important(important, other):
    text = SPECIFICATION.replace(", importance 1", "").replace(", importance 5", "")
    text = text.replace(f"= {important}[self]\n", f"= {important}[self] with importance 5\n")
    assert World(4, 4, text=text).steps()[0][1] == f"pos[0] for {other}[0]"
