"""The events that reached a node, with their times, recorded so that a replay has the same effects.

A journal is written as events happen, and survives a kill up to the last second. Replaying one tells what the specification made.
"""
