"""Batched multi-agent environments of the message-dropout paper: pure functions of tensors.

`registry.make("pursuit-n6")` gives the batched game, `parallel.parallel_env("pursuit-n6")` one game
as a PettingZoo `ParallelEnv` (extra `pettingzoo`).
"""
