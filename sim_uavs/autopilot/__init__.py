"""A simulated autopilot that speaks MAVLink 2 as ArduPilot and PX4 do.

Bytes and time in, bytes out; personas hold what sets the two apart. One server module waits on a socket.
"""
