"""Percepts as they come from sensors, detectors and files.

Lines of JSON are decoded strictly and grouped into ticks of one valid time. An unusable line is left out and reported
with its number, cause and remedy.
"""
