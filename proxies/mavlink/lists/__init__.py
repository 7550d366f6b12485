"""The lists of an autopilot, read by the mission protocol: its mission and its fence, item by item, with their
meaning.
"""
