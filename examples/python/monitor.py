"""A platform of one's own that watches its stream: an alarm opens while the speed is too high, in a loop of one's own."""

import dyknow

me = dyknow.join("8")
me.open()
me.source("speedometer", sort="speed", label="speed[self]")
me.monitor("slow", "always speed[self] < 14", on_alarm=lambda alarm: print(alarm.event, alarm.values))
for step in range(60):
    valid_us = me.now_us // 100_000 * 100_000
    me.push("speedometer", valid_us, 10.0 + step % 30 / 3)
    while me.now_us < valid_us + 100_000:
        me.step(timeout_s=0.02)
me.close()
