"""A fuzzer for every reader of what other people send: `make fuzz`."""
