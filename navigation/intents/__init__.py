"""Operational intents: where vehicles will be, whether two of them meet, and which ways are free of all others."""
