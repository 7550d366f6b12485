"""Formulas as trees, and their evaluation in one state (thesis 7.5).

One evaluation serves monitors, checks and margins. A tree does not know where its values come from.
"""
