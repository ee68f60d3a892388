"""Delay of the input: its past, what is predicted across it, and how much of it a loop bears."""
