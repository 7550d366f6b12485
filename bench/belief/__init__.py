"""Association of the observations of a scan with instances, next to a tracking library."""
