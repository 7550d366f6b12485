"""Recordings of federations: what a member of one saw, as an MCAP file that other tools open.

One is written while it happens and survives a kill up to the last second. Read again it is summarised, drawn, or played back as a federation.
"""
