"""The local channel between a platform and its knowledge process hosts: a Unix domain socket.

Messages have a length that is checked before memory is taken. Only processes of the platform's own user can connect.
"""
