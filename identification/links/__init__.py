"""Joints with a motor encoder and a link encoder: the differences between the two."""
