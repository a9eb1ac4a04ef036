"""What may explain a residual besides named physics: one file each, with its equation, source and scales."""
