"""A platform of a recorded federation, played back: it offers its recorded streams, and answers like any other.

Recorded samples, acts and alarms come as events; the edge that reads the recording decides when.
"""
