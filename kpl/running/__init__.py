"""A specification that runs: declarations become processes, streams and monitors, and change while they run.

The declarations that two specifications share continue untouched. Formulas and chronicles over streams are fed here.
"""
