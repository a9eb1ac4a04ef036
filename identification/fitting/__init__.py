"""The torque of a model, and the fit of its parameters to recordings."""
