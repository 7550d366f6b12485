"""Alarms as they open and close, of all platforms; ends at the first that has closed again."""

import dyknow

with dyknow.connect() as fed:
    for alarm in fed.alarms():
        print(alarm.event, alarm.monitor, "by", alarm.by, "about", *alarm.units, alarm.values)
        if alarm.event == "closed":
            break
