"""Missions whose leader is gone: a platform that takes part in one leads the rest of it.

Divisions of areas have their successors in `agents/areas`, monitoring tasks in `agents/monitoring`. The leader informs the other
platforms of what they need for that while it is there.
"""
