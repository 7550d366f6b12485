"""A platform of a federation as a value: events in, effects out (thesis 9.2, 9.3).

`platform.py` dispatches to a list of parts; each drawer holds the parts of one role. A part
declares its services to others as actions; nothing here reads a clock or a socket.
"""
