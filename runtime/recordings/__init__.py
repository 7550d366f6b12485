"""Files of recorded federations: a member's view, as MCAP that other tools open.

One is written while it happens and survives a kill up to the last second. Read again it is summarised, drawn, or played back as a federation.
"""
