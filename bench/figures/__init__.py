"""Pictures of the thesis, drawn from results."""
