"""Progression of metric temporal formulas over states (thesis 7.5.2).

A verdict comes at the first state that settles it, never later and never differently. One engine chooses the form that a formula needs.
"""
