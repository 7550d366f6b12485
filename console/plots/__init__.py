"""Plots: curves over time with gaps and violations, as a picture in a file.

Drawn with matplotlib, which is an extra of the package and imported when a picture is made.
"""
