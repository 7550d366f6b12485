"""Monitors over several units, queries about formulas and chronicles, and alarms (thesis 9.4.2).

From the name of a monitor to its plan, from streams to states, from states to alarms. The semantics of formulas are in
`reasoning`.
"""
