"""What a platform knows and tells of the others and of itself: the Directory Facilitator and questions about state.

The agent steps the platform's member. Subscriptions to directory changes are served here.
"""
