"""Checks whether a text is meaningful: names, arities, sorts, cycles, and probable mistakes (thesis 4.4, 4.5).

Every error is reported with its place and a repair, not only the first. Nothing here runs anything.
"""
