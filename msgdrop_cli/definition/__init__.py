"""What is asked: definitions, run specifications and their identity. No torch in this room."""
