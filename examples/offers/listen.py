"""Ten samples of gas-level, of the cheapest platform that is sure enough, and what happened in the call."""

import dyknow

COUNT = 10

with dyknow.connect("offers") as fed, fed.call("gas-level", every="500ms", min_certainty=0.8) as items:
    samples = 0
    for item in items:
        if hasattr(item, "event"):
            print(item.event, item.unit, item.text)
            continue
        print(item.unit, item.valid_us, item.value)
        samples += 1
        if samples == COUNT:
            break
