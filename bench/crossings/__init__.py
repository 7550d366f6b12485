"""Turns in crossings (thesis 8.7.4): simulated intersections, cars that pass them, and what is recognised of percepts.

`passes` makes crossings and cars from seeds, `recognition` anchors their percepts on the roads and passes on what changes.
"""
