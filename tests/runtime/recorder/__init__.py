"""What recorders pass their messages to."""
