"""The criteria of link processes: conditions over two objects, nearness, wanted objects.

A condition is a formula with a context for its labels; a gate gives the distance from which on it need not be
evaluated. Descriptions of wanted objects are conditions, too.
"""
