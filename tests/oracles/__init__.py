"""What tests compare with: written by hand in NumPy and SciPy, without the project's models."""
