"""The lists of an autopilot, read by the mission protocol: the items of its mission and its fence, interpreted."""
