"""Wheel speed and acceleration from an incremental encoder: teeth, time stamps, and what undoes the encoder's errors."""
