"""Commands that ask and task the members of a federation."""
