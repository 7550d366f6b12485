"""Policies: a subscriber's constraints on a stream, and the filters that satisfy them (thesis 4.4, 4.5).

One adapter enforces one constraint. Dropped samples are counted by reason.
"""
