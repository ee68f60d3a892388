"""What is done with the delay of an input: the predictor on chains and on the brake, and delay margins."""
