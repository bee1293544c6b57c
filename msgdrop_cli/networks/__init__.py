"""The paper's networks, stacked: one batched matrix product serves all agents of all runs.

Forward passes, and no training logic. A network maps inputs [G, B, (1 + S) * M] (own observation,
then messages) to Q-values [G, B, A].
"""
