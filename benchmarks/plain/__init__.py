"""The straightforward implementation: the paper's learners as a good researcher would write them.

One game in Python and numpy, one `nn.Module` and one Adam for each network, replay in numpy,
autograd, one thread, a loop over the agents. It is what `throughput.py` compares the engine with,
and shares no code with it. It takes the shortcuts that cost nothing in clarity (observations kept
in their own type, one conversion to a tensor per minibatch, no forward pass for a random action,
no gradient that nobody asks for) and none that do. `tests/test_plain.py` holds it to the same
games and the same networks.
"""
