"""Streams that cross platforms: what they mean, which contracts they have, how losses are recovered (thesis 9.3.3).

The ontology translates labels and units. Streams are numbered where they leave and recovered where they arrive.
"""
