"""Pursuit: rules, pictures, and policies that learn nothing."""
