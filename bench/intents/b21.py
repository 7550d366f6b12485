"""B21: what the intents of 50 others cost a platform: read, flown ahead with their contingencies, and looked at ten times a second."""

from collections.abc import Iterator
from contextlib import contextmanager
from random import Random
from time import process_time

from bench.rows import Figures, Limit, Options, Side
from dyknow import Sample
from dyknow.agents.capabilities.separation.logic import STEPS, SeparationLogic
from dyknow.agents.capabilities.separation.neighbours import Neighbours
from dyknow.agents.capabilities.separation.records import intent_of, intent_value
from dyknow.agents.capabilities.separation.situation import Situation
from dyknow.agents.places import Fix
from dyknow.navigation.intents.intent import Contingency, IntendedPlace, Intent, IntentEnding, IntentSource, RightOfWay
from dyknow.navigation.intents.path import FlatMotion, FlatOrigin, FlatPlace, Performance

TITLE = "intents of 50 vehicles at 1 Hz, ten looks a second: part of a core, and the longest look"
OTHERS, PERIOD_S, LOOKS_S = 50, 1.0, 0.1
BARS = (Limit("core", 0.05),)
_SECONDS = 20.0
_M = 1 / 111_320.0
_HERE = (58.0, 15.0, 60.0)


def _drawn(random: Random, at_us: int) -> Intent:
    """One of the others: within 400 m, at another level, with a way and a return that its failsafe would fly."""

    def place() -> IntendedPlace:
        north_m, east_m = random.uniform(-400, 400), random.uniform(-400, 400)
        return IntendedPlace(58.0 + north_m * _M, 15.0 + east_m * _M / 0.53, random.choice((20.0, 35.0, 90.0, 105.0)))

    start = place()
    back = Contingency(5.0, (start._replace(altitude_m=start.altitude_m), start), IntentEnding.LAND)
    return Intent(
        at_us, *start, random.uniform(-5, 5), random.uniform(-5, 5), 0.0, IntentSource.ROUTE, RightOfWay.NAMED,
        tuple(place()._replace(altitude_m=start.altitude_m) for _ in range(4)), contingency=back,
    )  # fmt: skip


def _flown(seconds: float, seed: int) -> Figures:
    random, origin = Random(seed), FlatOrigin.at(*_HERE[:2])
    others, logic = Neighbours(), SeparationLogic("0")
    motion, performance = FlatMotion(0.0, 0.0, 60.0, 5.0, 0.0, 0.0), Performance(5.0, 2.5, 1.5, 1.0, 0.5)
    fix = Fix(0, *_HERE, 5.0)
    began_s, longest_s, now_s = process_time(), 0.0, 0.0
    values = [intent_value(_drawn(random, 0)) for _ in range(OTHERS)]
    spent_s = 0.0
    while now_s < seconds:
        now_us = round(now_s * 1e6)
        began_s = process_time()
        if round(now_s / LOOKS_S) % round(PERIOD_S / LOOKS_S) == 0:
            for number, value in enumerate(values, 1):
                found = intent_of(Sample(now_us, now_us, value))
                if found is not None:
                    others.take(str(number), found, now_us)
        traffic = others.near(origin, fix, 5.0, now_us, STEPS)
        logic.look(
            Situation(
                now_us,
                RightOfWay.NAMED,
                "",
                motion,
                (FlatPlace(300.0, 0.0, 60.0),),
                IntentEnding.HOVER,
                performance,
                others.by_unit,
                traffic,
                lambda _place, _before: True,
            )
        )
        took_s = process_time() - began_s
        spent_s, longest_s, now_s = spent_s + took_s, max(longest_s, took_s), now_s + LOOKS_S
    return {"core": spent_s / seconds, "longest_look_ms": longest_s * 1000.0}


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    rounds = iter(range(10**6))

    def measured() -> Figures:
        return _flown(max(2.0, _SECONDS * options.effort), next(rounds))

    yield {"ours": measured}
