"""Messages on their way to a network: what is said (encoders), and who is heard (topologies)."""
