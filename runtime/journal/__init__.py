"""What reached a node and when, recorded so that it replays to the same effects.

A journal is written as events happen, and survives a kill up to the last second. Replaying one tells what the specification made.
"""
