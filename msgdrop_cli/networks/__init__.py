"""The paper's networks, stacked: one batched matrix product serves all agents of all runs.

No training logic here. A network maps inputs [G, B, (1 + S) * M] (the own observation first, then
the messages) to Q-values [G, B, A], and carries a gradient back into its weights by hand, because
for networks this small autograd's bookkeeping costs as much as the arithmetic.
"""
