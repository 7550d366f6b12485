"""The own vehicle as others are to know it: its intent, whether it flies what that says, and how fast it flies."""
