"""Wheel speed and acceleration from an incremental encoder: teeth, time stamps, compensation of its errors."""
