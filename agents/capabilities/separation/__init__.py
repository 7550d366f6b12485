"""Keeping apart: each vehicle publishes what it will do as an intent, and one rule for all decides which one yields, and how."""
