"""Ten samples of a stream: how high platform 0 flies, every 200 ms."""

from itertools import islice

import dyknow

with dyknow.connect() as fed, fed.watch("heli-altitude", unit="0", every="200ms") as samples:
    for sample in islice(samples, 10):
        print(sample.unit, sample.valid_us, sample.value)
