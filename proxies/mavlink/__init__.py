"""A vehicle on MAVLink: frames, reports in SI units, orders and their acknowledgements.

Wire units end here. One socket may serve several vehicles, distinguished by their system ids.
"""
