"""`python -m bench.needless --hours 1`: orders to keep apart in an hour of flight in which nothing is near.

A line by geometry. The bar is one order an hour of flight.
"""

import argparse
import sys
from collections import defaultdict
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import islice

from bench.needless.passing import GEOMETRIES, Passing, passed, seeds

AN_HOUR = 1.0
_AT_ONCE = 20


def flown(hours: float, jobs: int = 1) -> list[Passing]:
    """Flights of so many hours together, and as many of each geometry."""
    found: list[Passing] = []
    numbers = seeds()
    with ProcessPoolExecutor(jobs) as pool:
        while sum(each.flown_s for each in found) < hours * 3600.0:
            found += pool.map(passed, islice(numbers, _AT_ONCE))
    return found


def an_hour(found: Sequence[Passing]) -> float:
    """Orders in an hour of flight."""
    flown_s = sum(each.flown_s for each in found)
    return 3600.0 * sum(each.orders for each in found) / flown_s if flown_s else 0.0


def printed(found: Sequence[Passing]) -> str:
    """The table, as text."""
    having: dict[str, list[Passing]] = defaultdict(list)
    for each in found:
        having[each.geometry].append(each)
    lines = [f"{'':26}{'flights':>9}{'hours':>8}{'orders':>8}{'an hour':>9}{'least m':>9}{'seeds':>7}"]
    for name in (*GEOMETRIES, "all"):
        mine = list(found) if name == "all" else having[name]
        if not mine:
            continue
        hours, orders = sum(each.flown_s for each in mine) / 3600.0, sum(each.orders for each in mine)
        least_m, some = min(each.least_m for each in mine), [str(each.seed) for each in mine if each.orders][:5]
        lines.append(
            f"{name:26}{len(mine):>9}{hours:>8.2f}{orders:>8}{an_hour(mine):>9.1f}{least_m:>9.1f}  {' '.join(some)}"
        )
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m bench.needless", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--hours", type=float, default=1.0, help="of flight, of all vehicles together (1)")
    parser.add_argument("--jobs", type=int, default=1, help="processes at once (1)")
    asked = parser.parse_args()
    found = flown(asked.hours, asked.jobs)
    print(printed(found))
    rate, cpu_s = an_hour(found), sum(each.cpu_s for each in found)
    print(f"{'met' if rate <= AN_HOUR else 'NOT met'}: {rate:.1f} an hour; {cpu_s / len(found):.1f} CPU s a flight")
    return 0 if rate <= AN_HOUR else 1


if __name__ == "__main__":
    sys.exit(main())
