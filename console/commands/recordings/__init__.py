"""Commands about recordings of federations: made, summarised, played back.

What is in a file may come from anyone; it is shown as text only.
"""
