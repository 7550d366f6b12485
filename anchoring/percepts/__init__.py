"""Percepts as they come from sensors, detectors and files.

Lines of JSON are decoded strictly and grouped into ticks of one valid time. What is unusable is left out and reported with
its line, cause and remedy.
"""
