"""Features derived from streams of two units: distances, altitude differences, and when a pair is surely clear.

A feature names the streams it is made from. Add a feature here and formulas can speak of it.
"""
