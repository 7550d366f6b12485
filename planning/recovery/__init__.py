"""Recovery from faults of a plan: replanning from the state then, with what has been learned (thesis 7.5.3).

A violation ends the plan; units hold, assumptions change, objects are found again, and a plan is searched for from
there. Faults that come again and again end in a question, in fewer goals or in giving up.
"""
