"""One shared training engine: randomness, replay, training, evaluation, checkpoints, runs."""
