"""Commands that pass what the federation knows to other programs."""
