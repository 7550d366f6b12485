"""Access control: the Interface Agent, the only entrance and the only exit of a platform (thesis 9.3.2).

Every act passes its limits, its roles and the visibility of the service, and is noted in the audit log. A new rule about requests belongs here, a new request does not.
"""
