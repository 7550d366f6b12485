"""Plans for the logistics domain."""
