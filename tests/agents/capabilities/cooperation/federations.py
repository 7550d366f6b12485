"""Platforms of the simulated world that track cars given by hand, each under symbols of its own."""

from math import nan

from dyknow.agents.capabilities.cooperation.cooperation import Cooperation
from dyknow.agents.effects import Fed
from tests.agents.specification.test_specification_part import Pair

SPEC = """source tracked-object seen
strmgen cars = seen
export object-tracks = cars
"""
PERCEPTS = """source camera-percept seen
strmgen percepts = seen
export vision-percepts = percepts
"""


class Federation(Pair):
    """`drive` gives each platform what it tracks."""

    def drive(self, seconds, seen, period_us=100_000):
        """`seen` gives (symbol, x_m, y_m, vx_m_s, vy_m_s) by unit, at a time in seconds since the beginning of the world."""
        begin_us = self.world.now_us
        while (self.world.now_us - begin_us) / 1e6 < seconds:
            at_us = self.world.now_us // period_us * period_us
            for unit, tracks in seen((at_us - self.world.start_us) / 1e6).items():
                for symbol, *state in tracks:
                    self.feed(unit, self.record(unit, symbol, *state), at_us)
            self.world.run_for(period_us / 1e6)

    def record(self, unit, symbol, *state):
        """What a platform reports of one car."""
        return (symbol, *state, 0.36, 0.0, 0.36, 0.5, "red", True, False)

    def feed(self, unit, value, valid_us):
        node = self.world.nodes[unit]
        if node.process is not None:
            self.world._reach(node, Fed(self.world.now_us, "seen", valid_us, value))

    def part(self, unit):
        return self.world.platform(unit).part(Cooperation)

    def name(self, unit, symbol, of=None):
        return self.part(of or unit).picture.name_of(unit, symbol)

    def rows(self, unit):
        return {row.name: row for row in self.part(unit).picture.rows(self.world.now_us)}


def car(start_m, speed_m_s=10.0, y_m=0.0):
    return lambda t: (start_m + speed_m_s * t, y_m, speed_m_s, 0.0)


UNKNOWN = nan
