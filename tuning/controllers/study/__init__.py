"""The study of the controllers."""
