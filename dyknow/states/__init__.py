"""States: samples of several streams that belong to one instant (thesis 7.8).

A synchroniser waits for samples that may still come, as long as the policy allows. One of them serves many streams that
share inputs.
"""
