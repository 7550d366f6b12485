"""Execution of plans: the start of each action, and monitoring meanwhile (thesis 7.5-7.7).

Monitors are generated from a domain and a plan as formulas of `reasoning`. The executor is a value stepped by events,
with time as an argument; it returns effects.
"""
