"""Recovery from faults of a plan: replanning from the current state, with changed assumptions (thesis 7.5.3).

A violation ends the plan; units hold, assumptions change, objects are found again, and a plan is searched for from
there. Faults that come again and again end in a question, in fewer goals or in giving up.
"""
