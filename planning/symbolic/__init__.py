"""The symbolic part of domains and problems for other planners, and theirs for ours: unified-planning and PDDL.

Durations, deadlines, weights, opening hours, control formulas and monitors have no place there: the exporter lists
what it leaves out. unified-planning is the extra `planning`, imported when it is used.
"""
