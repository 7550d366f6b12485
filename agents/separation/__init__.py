"""Keeping apart: what each vehicle will do is said as an intent, and one rule for all says who yields, and how."""
