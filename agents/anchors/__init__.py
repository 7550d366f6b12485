"""Wanted objects whose percepts leave it open which one it is: the platform looks again, from elsewhere, until that is decided.

What was observed of each object is remembered; the plan that `planning/ambiguity` makes is flown, and its looks are answered.
`RecoveringAnchors` is the part; the rest are values that are stepped.
"""
