"""A specification that runs: declarations become processes, streams and monitors, and change while they run.

What two specifications share continues untouched. Formulas and chronicles over streams are fed here.
"""
