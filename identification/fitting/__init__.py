"""What the model says the torque is, and the fit of its parameters to recordings."""
