"""Waterworld: rules and their parts, pictures, and policies that learn nothing."""
