"""Streams that cross platforms: their meanings, their contracts, and the recovery of losses (thesis 9.3.3).

The ontology translates labels and units. Streams are numbered where they leave and recovered where they arrive.
"""
