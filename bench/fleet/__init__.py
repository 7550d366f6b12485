"""Whole platforms: many that monitor each other, their memory and start-up, the simulated world."""
