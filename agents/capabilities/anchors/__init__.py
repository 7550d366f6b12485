"""Wanted objects whose percepts leave it open which one it is: the platform looks again, from elsewhere, until that is decided.

The observed properties of each object are remembered; the plan of `planning/ambiguity` is flown, and its looks are
answered. `RecoveringAnchors` is the part; the rest are values that are stepped.
"""
