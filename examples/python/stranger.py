"""Query a label, join with a stream of one's own, and react to an alarm about it."""

import dyknow

with dyknow.connect() as fed, dyknow.join("9") as me:
    print("highest:", max(sample.value["altitude_m"] for sample in fed.query("heli-altitude")))
    me.source("thermometer", sort="celsius", label="heat[self]")
    me.monitor("cool", "always heat[self] < 30")
    for step in range(40):
        me.push("thermometer", me.now_us, 20.0 + step)
        alarm = me.alarms.get(timeout_s=0.1)
        if alarm is not None:
            print(alarm.event, alarm.monitor, alarm.values)
            break
