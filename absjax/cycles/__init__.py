"""Limit cycles: in closed form for two phases on XBS, by rollout for any automaton."""
