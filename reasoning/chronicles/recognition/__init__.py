"""Chronicles recognised online in events: partial instances, what settles them, what may be forgotten (thesis 8.4).

Memory is bounded by the chronicles' times, and by caps that are reported. Events come from changes in streams.
"""
