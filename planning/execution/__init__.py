"""Execution of plans: which action starts when, and what is monitored meanwhile (thesis 7.5-7.7).

Monitors are generated from a domain and a plan as formulas of `reasoning`. The executor is a value stepped by events,
with time as an argument; what is to be done is returned as effects.
"""
