"""The chain from encoder edges to wheel speed, tuned and judged."""
