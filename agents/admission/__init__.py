"""Access control of speech acts at the Interface Agent (thesis 9.3.2).

Every act passes its limits, its roles and the visibility of the service, and is noted in the audit log. A new rule
about requests belongs here, a new request does not.
"""
