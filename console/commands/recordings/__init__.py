"""Commands about recordings of federations: made, summarised, played back.

A file may come from anyone; its contents are shown as text only.
"""
