"""What a platform knows and tells of the others and of itself: the Directory Facilitator and questions about state.

Peers that come and go are turned into events for the other parts. Subscriptions to alarms, acts and directory changes are served here.
"""
