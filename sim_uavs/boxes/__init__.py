"""Boxes and carriers in the simulated world, and the winch with which a simulated UAV handles them.

The place of a box follows from the seed, the time and the list of handlings, which all processes of a federation share.
Platforms do not know it: they have the load on their line and the images of their cameras.
"""
