"""One picture from several platforms: car3 here is car7 there, and both have one common name.

Each platform reports its tracks with its names for them; from all reports each makes the picture for itself, and all
arrive at the same one. Nothing here reads a clock: reports and times are arguments.
"""
