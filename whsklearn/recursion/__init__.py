"""Compiled steps, state in and state out: the mathematics of the estimators."""
