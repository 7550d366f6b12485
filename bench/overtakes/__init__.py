"""Table 8.2 of the thesis, and reckless overtakes (8.2.2): cars on a road from seeds, seen with errors, and what is recognised.

`drives` makes the cars, `recognition` passes what is seen of them through the units and chronicles of examples/traffic.
"""
