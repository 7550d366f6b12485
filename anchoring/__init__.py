"""Which percept is which object: links between levels, roads, and percepts from outside.

An object is a symbol, a type and a stream of states. Links say which objects of two types are the same physical thing.
"""
