"""Messages on their way to a network: who is heard. One file a topology."""
