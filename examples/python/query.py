"""Where every platform is now, where platform 0 was a second ago, and how high it has flown since."""

import dyknow

with dyknow.connect() as fed:
    positions = fed.query("heli-position")
    for sample in positions:
        print(sample.unit, sample.value["latitude_deg"], sample.value["longitude_deg"], sample.valid_us)
    for unit, reason in positions.missing.items():
        print(f"platform {unit} is missing: {reason}")
    for sample in fed.query("heli-position", unit="0", at="-1s"):
        print("1 s ago:", dict(sample.value))
    heights = fed.query("heli-altitude", unit="0", between=("-1s", "now"))
    print(
        "between",
        min(one.value["altitude_m"] for one in heights),
        "m and",
        max(one.value["altitude_m"] for one in heights),
        "m",
    )
