"""Introspection of a running specification: its graph, figures, records, its governor, its verification.

Figures are streams like any other. The governor changes policies when there is too much to do (thesis 10.7).
"""
