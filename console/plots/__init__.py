"""Plots: curves over time with what lacks and what was violated, as a picture in a file.

Drawn with matplotlib, which is an extra of the package and imported when a picture is made.
"""
