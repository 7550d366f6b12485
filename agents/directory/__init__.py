"""The Directory Facilitator: the platforms of the federation, their services, labels and conditions.

The agent steps the platform's member. Subscriptions to directory changes are served here.
"""
