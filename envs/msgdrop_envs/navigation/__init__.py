"""Cooperative navigation: rules, pictures, and policies that learn nothing."""
