"""The platforms of a federation and what they offer, and how their monitors stand."""

import dyknow

with dyknow.connect() as fed:
    for platform in fed.ls():
        print(platform.unit, platform.state, *platform.labels)
    for monitor in fed.monitors():
        print(f"platform {monitor.by} monitors {monitor.name} of {monitor.units}: {monitor.shows}")
