"""World models, prior knowledge and observations as users write them.

All are read strictly: an entry that is unknown, mistyped, out of range or contradictory is refused with its place,
cause and remedy. Observations that are refused are left out one by one; a model is refused as a whole.
"""
