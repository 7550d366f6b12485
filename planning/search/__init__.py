"""Forward search for plans over partial state sequences.

Operators are bound lazily, features with real values are computed where they are asked for. Control formulas are
progressed by the engine of `reasoning`, one remainder for each node.
"""
