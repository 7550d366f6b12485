"""One picture from several platforms: that car3 here is car7 there, and what both are called.

Each platform reports the objects that it tracks and what it calls them; from the reports of all, each makes the picture for
itself, and all come to the same one. Nothing here reads a clock: reports and times are arguments.
"""
