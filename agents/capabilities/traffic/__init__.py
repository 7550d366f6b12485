"""Traffic that is no member: aircraft that transponders and sensors hear.

The picture of them from the vehicle's own receivers, from streams of hosts and from other platforms; which of them are our own vehicles,
heard as others hear them; and the alarms when one of the others comes near.
"""
