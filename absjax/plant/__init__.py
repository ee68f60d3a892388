"""What is braked: wheels, roads, vehicles, and the brake actuator."""
