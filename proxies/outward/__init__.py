"""The federation's data in formats of others: Cursor on Target and Remote ID, and the sockets through which it leaves.

Formats are functions of values; only `outlets` has a socket.
"""
