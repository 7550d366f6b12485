"""Conditional plans of actions that observe: which object it is, or where, is found out by looking from elsewhere.

Uncertainty is a set of hypotheses with degrees of possibility; a plan branches by observations, until all remaining
hypotheses have the same answer. Sources: "Have another look", section 4, and Karlsson's progressive conditional
planning.
"""
