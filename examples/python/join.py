"""A platform of one's own: it says how warm it is, for ten seconds, and others can query, watch and monitor that."""

import time

import dyknow

with dyknow.join("7") as me:
    me.source("gauge", sort="charge", label="charge[self]")
    me.export("battery", "charge[self]", every="100ms")
    for step in range(100):
        me.push("gauge", me.now_us, (1.0 - step / 1000,))
        time.sleep(0.1)
