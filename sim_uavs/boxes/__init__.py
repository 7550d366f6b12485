"""Boxes and carriers in the simulated world, and the winch with which a simulated UAV handles them.

Where a box is follows from the seed, the time and what was done with it, a list that all processes of a federation share.
Platforms do not know it: they have the load on their line and what their cameras find.
"""
