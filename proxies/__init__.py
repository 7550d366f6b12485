"""Where bytes enter and leave: Zenoh, MAVLink, recordings, and the local channel of hosts.

Edges stamp, decode once and post; effects become calls. Import a module by itself, since each loads a library.
"""
