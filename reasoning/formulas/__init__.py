"""Formulas as trees, and what one state makes of them (thesis 7.5).

One evaluation serves monitors, checks and margins. A tree does not know where its values come from.
"""
