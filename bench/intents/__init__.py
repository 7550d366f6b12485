"""What keeping apart costs a platform."""
