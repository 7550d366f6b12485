"""Recovery from an ambiguous anchor: hypotheses are built of a situation, and a plan that decides between them is executed.

It is a value that is stepped by percepts, observations and time, and returns actions to perform ("Have another look", section 4).
"""
