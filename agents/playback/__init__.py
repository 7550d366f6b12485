"""A platform of a recorded federation, played back: it offers what was recorded of it, and answers like any other.

What is played comes as events; when, the edge that reads the recording decides.
"""
