"""The results store: JSON and text, written whole or not at all, read with suspicion. No torch."""
