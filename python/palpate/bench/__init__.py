"""Measurements: the paper's evaluation, growth with size, other libraries, tuning."""
