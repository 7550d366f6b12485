"""The last two seconds of every platform's altitude as a pandas DataFrame: how high each was, on average."""

import dyknow

with dyknow.connect() as fed:
    heights = fed.query("heli-altitude", between=("-2s", "now")).frame()
    print(heights.groupby("unit")["altitude_m"].agg(["count", "mean"]).round(1).to_string())
