"""Policies: what a subscriber wants of a stream, and how samples are filtered to satisfy it (thesis 4.4, 4.5).

One adapter enforces one constraint. What is dropped is counted by reason.
"""
