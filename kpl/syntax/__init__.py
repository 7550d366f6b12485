"""Texts to trees and back: formulas, specifications and chronicles, two grammars (thesis 4.4, 7.5, 8.3).

Hostile texts meet limits before a parser sees them. Printing a tree and reading it gives the same tree.
"""
